"""Interface of what a scenario adds to the plant: disturbances and props."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.catalog import Surroundings
from surgsim.columns import Block
from surgsim.models.build import Scene
from surgsim.plant.state import State

BLOCK_TICKS = 1024
"""Parts may draw their noise for so many ticks at once, from a multiple of it on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PortMotion:
    """How far the incision's rest place has moved, world frame.

    Attributes:
        offset: From its configured place (3,) [m].
        velocity: (3,) [m/s].
    """

    offset: Array
    velocity: Array


class PlantPart:
    """A part of the plant. Subclasses override the hooks that they need; the others do nothing.

    A config builds it with its own random generator, from which its values are drawn if they have a spread:
    the same seed gives the same values.

    Attributes:
        columns: What it adds to the trace.
        touches_tip: Whether it can press on the instrument's tip, so that the force there is measured.
        adds_joints: Joints that it adds to the instrument, after the arm's.
        rank: Where it stands in the chains of `actuate` and `sense`: lower first, then as in the scenario.
        ranks: The same by the hook's name, where it differs.
        kernels: Compiled hooks by name, which stand for the methods of that name:
            status = hook(gains, world, memory, out), with the time of a physics step in `world.step_s` and
            `out` for `values`.
        gains: Their numbers, of a size that is fixed by `attach`; taken over after `start`.
        memory: Their memory at the beginning of a run, likewise.
    """

    columns: tuple[Block, ...] = ()
    touches_tip: bool = False
    adds_joints: int = 0
    rank: int = 0
    ranks: Mapping[str, int] = {}
    kernels: Mapping[str, Any] = {}
    gains: Array = np.zeros(0)
    memory: Array = np.zeros(0)

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Change the model before it is compiled."""

    def attach(self, scene: Scene, dt_s: float) -> None:
        """The scene is compiled, the control period is `dt_s` [s]: settle the sizes of gains and memory."""

    def start(self, scene: Scene, data: mujoco.MjData, rng: np.random.Generator, dt_s: float) -> None:
        """Forget the last run. `rng` is the part's own, `dt_s` the control period [s]."""

    def refill(self, memory: Array) -> None:
        """Draw into the kernels' `memory` what the next `BLOCK_TICKS` ticks need.

        Called after `start`, and whenever so many ticks have passed, before the next one.
        """

    def actuate(self, torque: Array) -> Array:
        """Torque (n,) [N m] that reaches the joints in this period, given the one commanded; once a tick."""
        return torque

    def grip(self, jaw: float) -> None:
        """The instrument's jaws are told to be closed by `jaw`, from 0 (open) to 1; once a tick."""

    def push(self, t_s: float, scene: Scene, data: mujoco.MjData) -> None:
        """Add forces at `t_s` [s] to `data.xfrc_applied` or `data.qfrc_applied`, zeroed before every step."""

    def port_motion(self, t_s: float) -> PortMotion | None:
        """Motion of the incision's rest place at `t_s` [s]."""
        return None

    def sense(self, state: State) -> State:
        """What is measured of `state`; once a tick, in the order of the ranks."""
        return state

    def values(self) -> Array:
        """Values of `columns` now."""
        return np.zeros(0)


class PlantPartConfig(Protocol):
    """What a scenario needs of the config of a disturbance or prop."""

    def check(self, scenario: Surroundings) -> None:
        """Refuse a scenario that the part does not fit.

        Raises:
            ValueError: With the reason.
        """
        ...

    def build(self, rng: np.random.Generator) -> PlantPart:
        """The part, its values drawn from `rng` if they have a spread."""
        ...
