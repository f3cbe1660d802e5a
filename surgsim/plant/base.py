"""Interface of a plant: what setup, loop, live sessions, learning environments and the bench need of one."""

from collections.abc import Mapping, Sequence
from typing import Protocol

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.catalog import Surroundings
from surgsim.columns import Block
from surgsim.models.build import Scene
from surgsim.plant.bore import Bore
from surgsim.plant.contacts import ContactWatch
from surgsim.plant.part import PlantPart
from surgsim.plant.state import State
from surgsim.plant.truth import Truth
from surgsim.plant.world import HookTable
from surgsim.tick.arrays import World


class Plant(Protocol):
    """The simulated arm with what surrounds it; alone in writing MuJoCo's data.

    The compiled loop works on its records, and lets a control period pass by its kernel,
    `status = advance(world, bore, hooks)` (`surgsim.plant.world.advance_signature`): the torques in
    `world.torque`, or the velocities in `world.qdot`, act for `world.dt_s`, then `world` says what is
    true and what is measured. A status that does not go on ends the run.

    Everything in it that changes over a run is in its records, in MuJoCo's data, in `arrays` or in
    `objects`, so that a run can be stored and gone on with.
    """

    @property
    def world(self) -> World:
        """The record of the plant."""
        ...

    @property
    def bore(self) -> Bore:
        """The record of the physical port; not used without a wall."""
        ...

    @property
    def hooks(self) -> HookTable:
        """The hooks of disturbances and props, and the values of the plant's own columns."""
        ...

    @property
    def watch(self) -> ContactWatch:
        """Looks for forbidden contacts."""
        ...

    @property
    def advance(self) -> int:
        """Address of the kernel of a control period."""
        ...

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo's data, to be read."""
        ...

    @property
    def columns(self) -> tuple[Block, ...]:
        """What it adds to the trace."""
        ...

    @property
    def arrays(self) -> Mapping[str, Array]:
        """Its arrays that change over a run and are in none of the records, by name."""
        ...

    @property
    def objects(self) -> Mapping[str, object]:
        """What of it is a Python object that changes over a run, by name."""
        ...

    def reset(self, q: Array) -> State:
        """Put the arm at rest at joint positions `q` (n,) [rad], at time zero, and forget the last run."""
        ...

    def refill(self) -> None:
        """Draw what the coming ticks need; called at least every `surgsim.plant.part.BLOCK_TICKS`."""
        ...

    def step(self, torque: Array, qdot: Array, jaw: float = 0.0) -> State:
        """Let a control period pass.

        Args:
            torque: Commanded torque (n,) [N m]; not used by a plant that follows velocities.
            qdot: Commanded joint velocities (n,) [rad/s]; not used by a plant that takes torques.
            jaw: How far the instrument's jaws are told to close, from 0 (open) to 1.
        """
        ...

    def state(self) -> State:
        """A copy of what is measured now."""
        ...

    def truth(self) -> Truth:
        """Where things really are now."""
        ...


class PlantConfig(Protocol):
    """What a scenario needs of a plant's config."""

    @property
    def type(self) -> str:
        """Its name."""
        ...

    @property
    def uses_torque(self) -> bool:
        """Whether the plant is driven by torques; else it follows the resolver's velocities."""
        ...

    def check(self, scenario: Surroundings) -> None:
        """Refuse a scenario that the plant does not fit.

        Raises:
            ValueError: With the reason.
        """
        ...

    def build(
        self, scene: Scene, control_period_s: float, parts: Sequence[PlantPart], seed: np.random.SeedSequence
    ) -> Plant:
        """The plant in `scene`, with disturbances and props; each draws from a child of `seed`."""
        ...
