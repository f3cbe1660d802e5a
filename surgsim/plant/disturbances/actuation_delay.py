"""Torques that act later than commanded."""

from collections import deque
from typing import Annotated, Literal

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from surgsim.models.build import Scene
from surgsim.plant.disturbances.base import DELAYED, Disturbance, DisturbanceConfig, whole_ticks

Array = NDArray[np.float64]


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

    def check(self, control_period_s: float) -> None:
        """Refuse times that are no whole multiple of the control period."""
        for key in ("delay_s", "jitter_s"):
            whole_ticks("actuation_delay", key, getattr(self, key), control_period_s)

    def build(self, rng: np.random.Generator) -> "ActuationDelay":
        """The disturbance."""
        return ActuationDelay(self)


class ActuationDelay(Disturbance):
    """A line on which every command travels for its own time, and none overtakes another.

    Command k arrives at tick a_k = max(k + d + j_k, a_{k-1}) with the delay d and the jitter j_k in ticks.
    Of those that arrive in one tick the newest acts; it holds until another arrives. Before the first arrives
    it acts already: the arm was being held before.
    """

    rank = DELAYED

    def __init__(self, config: ActuationDelayConfig) -> None:
        self._c = config
        self._line: deque[tuple[int, Array]] = deque()
        self._rng = np.random.default_rng(0)
        self._ticks = self._jitter = self._now = 0
        self._acting: Array | None = None

    def start(self, scene: Scene, data: mujoco.MjData, rng: np.random.Generator, dt_s: float) -> None:
        """Forget all commands."""
        self._ticks = round(self._c.delay_s / dt_s)
        self._jitter = round(self._c.jitter_s / dt_s)
        self._rng = rng
        self._line.clear()
        self._now, self._acting = 0, None

    def actuate(self, torque: Array) -> Array:
        """The newest torque that has arrived."""
        if self._acting is None:
            self._acting = torque
        late = int(self._rng.integers(self._jitter + 1)) if self._jitter else 0
        arrival = self._now + self._ticks + late
        if self._line:
            arrival = max(arrival, self._line[-1][0])
        self._line.append((arrival, torque))
        while self._line and self._line[0][0] <= self._now:
            self._acting = self._line.popleft()[1]
        self._now += 1
        return self._acting
