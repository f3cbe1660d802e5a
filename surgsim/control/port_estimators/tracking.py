"""Tracking: position, velocity and acceleration of a trocar whose position is measured."""

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.control.port_estimators.base import KernelPortEstimator
from surgsim.models.arm import ArmModel
from surgsim.tick.arrays import Seen
from surgsim.tick.status import GOES_ON


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

    def build(self, arm: ArmModel) -> KernelPortEstimator:
        """The estimator; gains memory_s, sample_hold_s; memory rows motion (3, 3), seen (3,), since."""
        gains = np.array([self.memory_s, self.sample_hold_s])
        return KernelPortEstimator(kernel=tracking, arm=arm, gains=gains, memory_size=13)


@compiled
def tracking(gains: Array, seen: Seen, memory: Array, out: Array) -> int:
    """X <- predicted x + gain (sample - predicted position), at every new sample.

        gains  1 - b^3,  3/2 (1 - b)^2 (1 + b) / T,  (1 - b)^3 / T^2,      b = exp(-T / memory)

    with T the time since the last sample: all three poles of the error are b, and a constant acceleration is
    followed without lag. It starts at rest at the first sample.

    Source: the fading-memory polynomial filter of degree two (Morrison, Introduction to Sequential Smoothing
    and Prediction, 1969).
    """
    dt, x, sample = seen.dt_s, memory[:9].reshape((3, 3)), memory[9:12]
    if seen.first != 0:
        for i in range(3):
            x[0, i] = sample[i] = seen.p_WC[i]
    memory[12] += dt
    is_new = memory[12] >= gains[1] - 1e-9
    for i in range(3):
        x[0, i] += dt * (x[1, i] + 0.5 * dt * x[2, i])
        x[1, i] += dt * x[2, i]
        is_new = is_new or seen.p_WC[i] != sample[i]
    if is_new:
        T = memory[12]
        b = math.exp(-T / gains[0])
        left = 1.0 - b
        for i in range(3):
            gap = seen.p_WC[i] - x[0, i]
            x[0, i] += (1.0 - b * b * b) * gap
            x[1, i] += 1.5 * left * left * (1.0 + b) / T * gap
            x[2, i] += left * left * left / (T * T) * gap
            sample[i] = seen.p_WC[i]
        memory[12] = 0.0
    for k in range(3):
        for i in range(3):
            out[k, i] = x[k, i]
    return GOES_ON
