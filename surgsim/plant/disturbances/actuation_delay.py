"""Torques that act later than commanded."""

from collections import deque
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from surgsim.catalog import PartConfig
from surgsim.errors import SurgsimError
from surgsim.models.build import Scene
from surgsim.plant.disturbances.base import Disturbance

Array = NDArray[np.float64]


class ActuationDelayConfig(PartConfig):
    """A constant delay between the torque command and the torque.

    Attributes:
        delay_s: The delay, a whole multiple of the control period [s].
    """

    type: Literal["actuation_delay"] = "actuation_delay"
    delay_s: Annotated[float, Field(gt=0.0, le=0.5)] = 0.005

    def build(self) -> "ActuationDelay":
        """The disturbance."""
        return ActuationDelay(self)


class ActuationDelay(Disturbance):
    """A queue of commands, full of the first one at the start: the arm was being held before."""

    def __init__(self, config: ActuationDelayConfig) -> None:
        self._c = config
        self._queue: deque[Array] = deque()
        self._ticks = 0

    def start(self, scene: Scene, rng: np.random.Generator, dt_s: float) -> None:
        """Forget all commands.

        Raises:
            SurgsimError: If the delay is not a whole multiple of the control period.
        """
        ratio = self._c.delay_s / dt_s
        if abs(ratio - round(ratio)) > 1e-6 or round(ratio) < 1:
            raise SurgsimError(
                f"actuation_delay: delay_s {self._c.delay_s:g} must be a whole multiple of the control "
                f"period {dt_s:g}"
            )
        self._ticks = round(ratio)
        self._queue.clear()

    def delay(self, torque: Array) -> Array:
        """The torque commanded `delay_s` ago."""
        if not self._queue:
            self._queue.extend([torque] * self._ticks)
        self._queue.append(torque)
        return self._queue.popleft()
