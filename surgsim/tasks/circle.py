"""Circle: a circular cut, e.g. around a tumour."""

import math
from typing import Any, ClassVar, Literal

from pydantic import PositiveFloat

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.tasks.base import PathTaskConfig, Turns, following


@compiled
def circle_path(numbers: Array, s: float, rows: Array) -> None:
    """Rows point and derivatives (3, 3) in path axes."""
    R, w = numbers[0], 2.0 * math.pi * numbers[1]
    c, n = R * math.cos(w * s), R * math.sin(w * s)
    rows[:] = 0.0
    rows[0, 0], rows[0, 1] = c - R, n
    rows[1, 0], rows[1, 1] = -w * n, w * c
    rows[2, 0], rows[2, 1] = -w * w * c, -w * w * n


class CircleConfig(PathTaskConfig):
    """Circle in the path's plane, beginning at its point furthest along the path's x axis.

    p(s) = R (cos a - 1, sin a, 0), a = 2 pi turns s. Default dimensions: Table 1 of the manipulability
    paper.
    """

    kernel: ClassVar[Any] = staticmethod(following(circle_path))

    type: Literal["circle"] = "circle"
    radius_m: PositiveFloat = 0.02
    turns: Turns = 1.0

    @property
    def numbers(self) -> tuple[float, ...]:
        """The numbers of the path."""
        return (self.radius_m, self.turns)
