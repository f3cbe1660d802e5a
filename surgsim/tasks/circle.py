"""Circle: a circular cut, e.g. around a tumour."""

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
def circle_path(numbers: Array, s: float, rows: Array) -> None:
    """Rows point and derivatives (3, 3) in path axes."""
    R, w = numbers[0], 2.0 * math.pi * numbers[1]
    c, n = R * math.cos(w * s), R * math.sin(w * s)
    rows[:] = 0.0
    rows[0, 0], rows[0, 1] = c - R, n
    rows[1, 0], rows[1, 1] = -w * n, w * c
    rows[2, 0], rows[2, 1] = -w * w * c, -w * w * n


@compiled
def circle(gains: Array, feedback: Feedback, memory: Array, out: Command) -> int:
    """The path followed with the profile's progress."""
    s, s_dot, s_ddot = progress(gains[HOLD], gains[DURATION], gains[RAMP], feedback.t_s)
    rows = scratch_matrix(3, 3)
    circle_path(gains[NUMBERS:], s, rows)
    follow(gains, rows, s_dot, s_ddot, out)
    return GOES_ON


class CircleConfig(PathTaskConfig):
    """Circle in the path's plane, beginning at its point furthest along the path's x axis.

    p(s) = R (cos a - 1, sin a, 0), a = 2 pi turns s. Default dimensions: Table 1 of the manipulability
    paper.
    """

    kernel: ClassVar[Any] = staticmethod(circle)

    type: Literal["circle"] = "circle"
    radius_m: PositiveFloat = 0.02
    turns: Turns = 1.0

    @property
    def path(self) -> tuple[Any, tuple[float, ...]]:
        """The kernel of the path and its numbers."""
        return circle_path, (self.radius_m, self.turns)
