"""Spiral (a helix): the pattern of a simple continuous suture."""

import math
from typing import Any, ClassVar, Literal

from pydantic import PositiveFloat

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.tasks.base import PathTaskConfig, Turns, following


@compiled
def spiral_path(numbers: Array, s: float, rows: Array) -> None:
    """Rows point and derivatives (3, 3) in path axes."""
    R, L, w = numbers[0], numbers[1], 2.0 * math.pi * numbers[2]
    c, n = R * math.cos(w * s), R * math.sin(w * s)
    rows[:] = 0.0
    rows[0, 0], rows[0, 1], rows[0, 2] = c - R, n, L * s
    rows[1, 0], rows[1, 1], rows[1, 2] = -w * n, w * c, L
    rows[2, 0], rows[2, 1] = -w * w * c, -w * w * n


class SpiralConfig(PathTaskConfig):
    """Helix that advances along the path's z axis (`normal`).

    p(s) = (R (cos a - 1), R sin a, L s), a = 2 pi turns s. Default dimensions: Table 1 of the
    manipulability paper; the number of turns is not given there.
    """

    kernel: ClassVar[Any] = staticmethod(following(spiral_path))

    type: Literal["spiral"] = "spiral"
    radius_m: PositiveFloat = 0.01
    length_m: PositiveFloat = 0.05
    turns: Turns = 6.0

    @property
    def numbers(self) -> tuple[float, ...]:
        """The numbers of the path."""
        return (self.radius_m, self.length_m, self.turns)
