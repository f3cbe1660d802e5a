"""Control ticks that come late or not at all."""

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

import mujoco
import numpy as np
from pydantic import Field

from surgsim.array import Array
from surgsim.catalog import ADDED
from surgsim.columns import scalar
from surgsim.compiled import compiled
from surgsim.models.build import Scene
from surgsim.plant.disturbances.base import Disturbance, DisturbanceConfig
from surgsim.plant.part import BLOCK_TICKS
from surgsim.tick.arrays import World
from surgsim.tick.status import GOES_ON, PACKETS_LOST

IN_A_ROW, TOLD, LOST = 0, 1, 2
"""Memory: ticks lost in a row so far, whether that was told, which of the coming ticks are lost
(BLOCK_TICKS,); then the last torque (n,) and the last joint positions (n,) that came in time."""


@compiled
def hold(gains: Array, world: World, memory: Array, out: Array) -> int:
    """The command, or in a burst the last torque before it; gains: so many lost in a row are told.

    After it was told nothing is lost: an arm that stops by itself needs no commands.
    """
    n = world.torque.size
    torque = memory[LOST + BLOCK_TICKS : LOST + BLOCK_TICKS + n]
    q_cmd = memory[LOST + BLOCK_TICKS + n :]
    if memory[LOST + world.tick % BLOCK_TICKS] == 0.0 or memory[TOLD] != 0.0:
        memory[IN_A_ROW] = 0.0
        for i in range(n):
            torque[i], q_cmd[i] = world.torque[i], world.q_cmd[i]
        return GOES_ON
    memory[IN_A_ROW] += 1.0
    for i in range(n):
        world.torque[i] = torque[i]
        world.q_cmd[i] = q_cmd[i] if math.isnan(q_cmd[i]) else math.inf
    if memory[IN_A_ROW] < gains[0]:
        return GOES_ON
    memory[TOLD] = 1.0
    return PACKETS_LOST


@compiled
def record(gains: Array, world: World, memory: Array, out: Array) -> int:
    """Column: ticks lost in a row."""
    if out.size > 0:
        out[0] = memory[IN_A_ROW]
    return GOES_ON


class LateTicksConfig(DisturbanceConfig):
    """Control ticks whose torque does not arrive in time, alone or in bursts; the last torque holds.

    A torque that is not there when its period begins is lost: the next one replaces it. Lateness by a share
    of a period is not resolved. An arm whose own impedance loop is commanded goes on with the acceleration
    that it was last commanded.

    Attributes:
        probability: That a burst begins at a tick.
        burst_ticks: Ticks lost in a burst; drawn for each burst, uniformly from 1 to it.
        stop_after_ticks: So many ticks lost in a row end the run, as the arm's interface does; null: none do.
    """

    type: Literal["late_ticks"] = "late_ticks"
    probability: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.01
    burst_ticks: Annotated[int, Field(ge=1, le=1000)] = 3
    stop_after_ticks: Annotated[Annotated[int, Field(ge=1, le=1000)] | None, ADDED] = None

    def build(self, rng: np.random.Generator) -> "LateTicks":
        """The disturbance."""
        return LateTicks(self)


class LateTicks(Disturbance):
    """Holds the last torque that came in time; the first always does.

    Records the ticks lost in a row as `lost_ticks` where so many of them end the run.
    """

    kernels: Mapping[str, Any] = {"actuate": hold, "values": record}

    def __init__(self, config: LateTicksConfig) -> None:
        self._c = config
        self._rng = np.random.default_rng(0)
        self._left, self._first = 0, True
        most = config.stop_after_ticks
        self.gains = np.array([np.inf if most is None else float(most)])
        self.columns = () if most is None else (scalar("lost_ticks"),)

    def attach(self, scene: Scene, dt_s: float) -> None:
        """Make room for the command that holds."""
        self.memory = np.zeros(LOST + BLOCK_TICKS + 2 * len(scene.dof_ids))

    def start(self, scene: Scene, data: mujoco.MjData, rng: np.random.Generator, dt_s: float) -> None:
        """No burst is on, no torque has come."""
        self._rng, self._left, self._first = rng, 0, True

    def refill(self, memory: Array) -> None:
        """Draw which of the coming ticks are lost."""
        for tick in range(BLOCK_TICKS):
            memory[LOST + tick] = 0.0 if self._first else self._is_lost()
            self._first = False

    def _is_lost(self) -> float:
        """Whether the next tick is lost, 1 or 0."""
        if self._left == 0 and self._rng.random() < self._c.probability:
            self._left = int(self._rng.integers(1, self._c.burst_ticks + 1))
        if self._left == 0:
            return 0.0
        self._left -= 1
        return 1.0
