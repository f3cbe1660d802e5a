"""Torques that act later than commanded."""

from collections import deque
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from surgsim.models.build import Scene
from surgsim.plant.disturbances.base import Disturbance, DisturbanceConfig

Array = NDArray[np.float64]


class ActuationDelayConfig(DisturbanceConfig):
    """A constant delay between the torque command and the torque.

    Attributes:
        delay_s: The delay, a whole multiple of the control period [s].
    """

    type: Literal["actuation_delay"] = "actuation_delay"
    delay_s: Annotated[float, Field(gt=0.0, le=0.5)] = 0.005

    def check(self, control_period_s: float) -> None:
        """Refuse a delay that is no whole multiple of the control period."""
        ratio = self.delay_s / control_period_s
        if abs(ratio - round(ratio)) > 1e-6 or round(ratio) < 1:
            raise ValueError(
                f"actuation_delay: delay_s {self.delay_s:g} must be a whole multiple of control_period_s "
                f"{control_period_s:g}"
            )

    def build(self, rng: np.random.Generator) -> "ActuationDelay":
        """The disturbance."""
        return ActuationDelay(self)


class ActuationDelay(Disturbance):
    """A queue of commands, full of the first one at the start: the arm was being held before."""

    def __init__(self, config: ActuationDelayConfig) -> None:
        self._c = config
        self._queue: deque[Array] = deque()
        self._ticks = 0

    def start(self, scene: Scene, rng: np.random.Generator, dt_s: float) -> None:
        """Forget all commands."""
        self._ticks = round(self._c.delay_s / dt_s)
        self._queue.clear()

    def delay(self, torque: Array) -> Array:
        """The torque commanded `delay_s` ago."""
        if not self._queue:
            self._queue.extend([torque] * self._ticks)
        self._queue.append(torque)
        return self._queue.popleft()
