"""Control ticks that come late or not at all."""

from typing import Annotated, Literal

import mujoco
import numpy as np
from pydantic import Field

from surgsim.array import Array
from surgsim.models.build import Scene
from surgsim.plant.disturbances.base import Disturbance, DisturbanceConfig


class LateTicksConfig(DisturbanceConfig):
    """Control ticks whose torque does not arrive in time, alone or in bursts; the last torque holds.

    A torque that is not there when its period begins is lost: the next one replaces it. Lateness by a share
    of a period is not resolved.

    Attributes:
        probability: That a burst begins at a tick.
        burst_ticks: Ticks lost in a burst; drawn for each burst, uniformly from 1 to it.
    """

    type: Literal["late_ticks"] = "late_ticks"
    probability: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.01
    burst_ticks: Annotated[int, Field(ge=1, le=1000)] = 3

    def build(self, rng: np.random.Generator) -> "LateTicks":
        """The disturbance."""
        return LateTicks(self)


class LateTicks(Disturbance):
    """Holds the last torque that came in time; the first always does."""

    def __init__(self, config: LateTicksConfig) -> None:
        self._c = config
        self._rng = np.random.default_rng(0)
        self._left = 0
        self._last: Array | None = None

    def start(self, scene: Scene, data: mujoco.MjData, rng: np.random.Generator, dt_s: float) -> None:
        """No burst is on, no torque has come."""
        self._rng, self._left, self._last = rng, 0, None

    def actuate(self, torque: Array) -> Array:
        """The torque, or in a burst the last one before it."""
        if self._last is not None:
            if self._left == 0 and self._rng.random() < self._c.probability:
                self._left = int(self._rng.integers(1, self._c.burst_ticks + 1))
            if self._left > 0:
                self._left -= 1
                return self._last
        self._last = torque
        return torque
