"""Tracking: position, velocity and acceleration of a trocar whose position is measured."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from surgsim.catalog import PartConfig
from surgsim.control.port_estimators.base import PortEstimate, PortProblem
from surgsim.models.arm import ArmModel

Array = NDArray[np.float64]


class TrackingConfig(PartConfig):
    """Follows a measured trocar with a fading-memory filter of second order.

    Attributes:
        memory_s: Time constant of the filter's memory: longer is smoother, and later where the acceleration
            changes [s].
        sample_hold_s: A position that has not changed for so long counts as a new sample [s]. A shorter hold
            is the tracker's sampling period.
    """

    type: Literal["tracking"] = "tracking"
    memory_s: Annotated[float, Field(gt=0.0, le=1.0)] = 0.02
    sample_hold_s: Annotated[float, Field(gt=0.0, le=1.0)] = 0.05

    def build(self, arm: ArmModel) -> "Tracking":
        """The estimator."""
        return Tracking(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackingMemory:
    """State of the filter.

    Attributes:
        motion: Rows position, velocity and acceleration (3, 3), SI.
        seen: Last new sample (3,) [m].
        since_s: Time since it [s].
    """

    motion: Array
    seen: Array
    since_s: float = 0.0


class Tracking:
    """x <- predicted x + gain (sample - predicted position), at every new sample.

        gains  1 - b^3,  3/2 (1 - b)^2 (1 + b) / T,  (1 - b)^3 / T^2,      b = exp(-T / memory)

    with T the time since the last sample: all three poles of the error are b, and a constant acceleration is
    followed without lag. It starts at rest.

    Source: the fading-memory polynomial filter of degree two (Morrison, Introduction to Sequential Smoothing
    and Prediction, 1969).
    """

    def __init__(self, config: TrackingConfig) -> None:
        self._c = config

    def start(self, problem: PortProblem) -> TrackingMemory:
        """At the first sample, at rest."""
        motion = np.zeros((3, 3))
        motion[0] = problem.p_WC
        return TrackingMemory(motion=motion, seen=problem.p_WC.copy())

    def step(self, problem: PortProblem, memory: TrackingMemory) -> tuple[PortEstimate, TrackingMemory]:
        """Predict over the period since the last tick, and take in a new sample if there is one."""
        dt, x = problem.dt_s, memory.motion
        since = memory.since_s + dt
        ahead = np.array([x[0] + dt * (x[1] + 0.5 * dt * x[2]), x[1] + dt * x[2], x[2]])
        new = since >= self._c.sample_hold_s - 1e-9 or not np.array_equal(problem.p_WC, memory.seen)
        if new:
            gains = _gains(since, self._c.memory_s)
            ahead = ahead + gains[:, None] * (problem.p_WC - ahead[0])
            memory = TrackingMemory(motion=ahead, seen=problem.p_WC.copy())
        else:
            memory = TrackingMemory(motion=ahead, seen=memory.seen, since_s=since)
        return PortEstimate(p_WC=ahead[0], v_WC=ahead[1], a_WC=ahead[2]), memory


def _gains(T: float, memory_s: float) -> Array:
    """Gains of position, velocity and acceleration (3,) for a sample after `T` [s]."""
    b = math.exp(-T / memory_s)
    return np.array([1.0 - b**3, 1.5 * (1.0 - b) ** 2 * (1.0 + b) / T, (1.0 - b) ** 3 / T**2])
