"""Measurements that are old when the controller sees them."""

from collections import deque
from dataclasses import replace
from typing import Annotated, Literal

import mujoco
import numpy as np
from pydantic import Field

from surgsim.models.build import Scene
from surgsim.plant.disturbances.base import LATE, Disturbance, DisturbanceConfig, whole_ticks
from surgsim.plant.state import State


class SensorDelayConfig(DisturbanceConfig):
    """The whole measured state is old: joints, torques, port and tip force; the time is the present.

    Attributes:
        delay_s: Its age, a whole multiple of the control period [s].
    """

    type: Literal["sensor_delay"] = "sensor_delay"
    delay_s: Annotated[float, Field(gt=0.0, le=0.5)] = 0.002

    def check(self, control_period_s: float) -> None:
        """Refuse a delay that is no whole multiple of the control period."""
        whole_ticks("sensor_delay", "delay_s", self.delay_s, control_period_s)

    def build(self, rng: np.random.Generator) -> "SensorDelay":
        """The disturbance."""
        return SensorDelay(self)


class SensorDelay(Disturbance):
    """A queue of states, full of the first one at the start: the arm was at rest before."""

    rank = LATE

    def __init__(self, config: SensorDelayConfig) -> None:
        self._c = config
        self._queue: deque[State] = deque()
        self._ticks = 0

    def start(self, scene: Scene, data: mujoco.MjData, rng: np.random.Generator, dt_s: float) -> None:
        """Forget all states."""
        self._ticks = round(self._c.delay_s / dt_s)
        self._queue.clear()

    def sense(self, state: State) -> State:
        """The state of `delay_s` ago, at the present time."""
        if not self._queue:
            self._queue.extend([state] * self._ticks)
        self._queue.append(state)
        return replace(self._queue.popleft(), t_s=state.t_s)
