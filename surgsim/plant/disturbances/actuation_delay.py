"""Torques that act later than commanded."""

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

import mujoco
import numpy as np
from pydantic import Field

from surgsim.array import Array
from surgsim.catalog import Surroundings
from surgsim.compiled import compiled
from surgsim.models.build import Scene
from surgsim.plant.disturbances.base import DELAYED, Disturbance, DisturbanceConfig, whole_ticks
from surgsim.plant.part import BLOCK_TICKS
from surgsim.tick.arrays import World
from surgsim.tick.status import GOES_ON

DELAY, ROOM = 0, 1
"""Gains: d in ticks, and how many commands can be on the line."""
OLDEST, ACTING = 0, 1
"""Memory: the oldest command on the line, the torque that acts (n,); then jitter, arrivals, torques, and the
joint positions with them."""


@compiled
def carry(gains: Array, world: World, memory: Array, out: Array) -> int:
    """The newest torque that has arrived acts.

    Command k arrives at tick a_k = max(k + d + j_k, a_{k-1}) with the delay d and the jitter j_k in ticks.
    Of those that arrive in one tick the newest acts; it holds until another arrives. Before the first arrives
    it acts already: the arm was being held before. Joint positions for the arm's own loop arrive with it;
    where none arrive in a tick, that is said.
    """
    n, k, room = world.torque.size, world.tick, int(gains[ROOM])
    begin = ACTING + n + BLOCK_TICKS
    acting, jitter = memory[ACTING : ACTING + n], memory[ACTING + n : begin]
    arrivals, torques = memory[begin : begin + room], memory[begin + room :]
    references, arrived = torques[room * n :], k == 0
    at = k % room
    arrivals[at] = max(k + gains[DELAY] + jitter[k % BLOCK_TICKS], arrivals[(k - 1) % room])
    for i in range(n):
        torques[at * n + i] = world.torque[i]
        references[at * n + i] = world.q_cmd[i]
        if k == 0:
            acting[i] = world.torque[i]
    while memory[OLDEST] <= k and arrivals[int(memory[OLDEST]) % room] <= k:
        at = int(memory[OLDEST]) % room
        for i in range(n):
            acting[i] = torques[at * n + i]
        memory[OLDEST] += 1.0
        arrived = True
    latest = (max(int(memory[OLDEST]) - 1, 0) % room) * n
    for i in range(n):
        world.torque[i] = acting[i]
        world.q_cmd[i] = references[latest + i]
        if not (arrived or math.isnan(world.q_cmd[i])):
            world.q_cmd[i] = math.inf
    return GOES_ON


class ActuationDelayConfig(DisturbanceConfig):
    """A constant or varying delay between the torque command and the torque.

    Attributes:
        delay_s: The delay, or the least delay with jitter, a whole multiple of the control period [s].
        jitter_s: How much later a command may arrive, a whole multiple of the control period [s]; drawn
            for each command, uniformly over the whole periods from 0 to it.
    """

    type: Literal["actuation_delay"] = "actuation_delay"
    delay_s: Annotated[float, Field(gt=0.0, le=0.5)] = 0.005
    jitter_s: Annotated[float, Field(ge=0.0, le=0.5)] = 0.0

    def check(self, scenario: Surroundings) -> None:
        """Refuse times that are no whole multiple of the control period."""
        for key in ("delay_s", "jitter_s"):
            whole_ticks("actuation_delay", key, getattr(self, key), scenario.control_period_s)

    def build(self, rng: np.random.Generator) -> "ActuationDelay":
        """The disturbance."""
        return ActuationDelay(self)


class ActuationDelay(Disturbance):
    """A line on which every command travels for its own time, and none overtakes another."""

    rank = DELAYED
    kernels: Mapping[str, Any] = {"actuate": carry}

    def __init__(self, config: ActuationDelayConfig) -> None:
        self._c = config
        self._rng = np.random.default_rng(0)
        self._jitter, self._first = 0, 0

    def attach(self, scene: Scene, dt_s: float) -> None:
        """Make room for the commands."""
        n, ticks, self._jitter = (
            len(scene.dof_ids),
            round(self._c.delay_s / dt_s),
            round(self._c.jitter_s / dt_s),
        )
        room = ticks + self._jitter + 2
        self._first = ACTING + n
        self.gains = np.array([float(ticks), float(room)])
        self.memory = np.zeros(self._first + BLOCK_TICKS + room * (1 + 2 * n))

    def start(self, scene: Scene, data: mujoco.MjData, rng: np.random.Generator, dt_s: float) -> None:
        """Draw from the beginning."""
        self._rng = rng

    def refill(self, memory: Array) -> None:
        """Draw the jitter of the coming ticks."""
        if self._jitter:
            drawn = self._rng.integers(self._jitter + 1, size=BLOCK_TICKS)
            memory[self._first : self._first + BLOCK_TICKS] = drawn
