"""Sinusoid: a wavy incision such as the coronal one."""

import math
from typing import Any, ClassVar, Literal

from pydantic import PositiveFloat

from surgsim.compiled import compiled
from surgsim.tasks.base import DURATION, HOLD, NUMBERS, RAMP, Array, PathTaskConfig, Turns, follow
from surgsim.tasks.profile import progress
from surgsim.tick.arrays import Command, Feedback
from surgsim.tick.scratch import scratch_matrix
from surgsim.tick.status import GOES_ON


@compiled
def sinusoid_path(numbers: Array, s: float, rows: Array) -> None:
    """Rows point and derivatives (3, 3) in path axes."""
    A, L, w = numbers[0], numbers[1], 2.0 * math.pi * numbers[2]
    c, n = A * math.cos(w * s), A * math.sin(w * s)
    rows[:] = 0.0
    rows[0, 0], rows[0, 1] = L * s, n
    rows[1, 0], rows[1, 1] = L, w * c
    rows[2, 1] = -w * w * n


@compiled
def sinusoid(gains: Array, feedback: Feedback, memory: Array, out: Command) -> int:
    """The path followed with the profile's progress."""
    s, s_dot, s_ddot = progress(gains[HOLD], gains[DURATION], gains[RAMP], feedback.t_s)
    rows = scratch_matrix(3, 3)
    sinusoid_path(gains[NUMBERS:], s, rows)
    follow(gains, rows, s_dot, s_ddot, out)
    return GOES_ON


class SinusoidConfig(PathTaskConfig):
    """Sine wave along the path's x axis with its amplitude along y.

    p(s) = (L s, A sin(2 pi periods s), 0). Default dimensions: Table 1 of the manipulability paper; the
    number of periods is not given there.
    """

    kernel: ClassVar[Any] = staticmethod(sinusoid)

    type: Literal["sinusoid"] = "sinusoid"
    amplitude_m: PositiveFloat = 0.01
    length_m: PositiveFloat = 0.25
    periods: Turns = 2.0

    @property
    def path(self) -> tuple[Any, tuple[float, ...]]:
        """The kernel of the path and its numbers."""
        return sinusoid_path, (self.amplitude_m, self.length_m, self.periods)
