"""Depth: the instrument goes in and out while its tip circles."""

import math
from typing import Any, ClassVar, Literal

from pydantic import NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.tasks.base import PathTaskConfig, Turns, following


@compiled
def depth_path(numbers: Array, s: float, rows: Array) -> None:
    """Rows point and derivatives (3, 3) in path axes."""
    R, w, D, u = numbers[0], 2.0 * math.pi * numbers[1], 0.5 * numbers[2], 2.0 * math.pi * numbers[3]
    c, n = R * math.cos(w * s), R * math.sin(w * s)
    d, m = D * math.cos(u * s), D * math.sin(u * s)
    rows[0, 0], rows[0, 1], rows[0, 2] = c - R, n, D - d
    rows[1, 0], rows[1, 1], rows[1, 2] = -w * n, w * c, u * m
    rows[2, 0], rows[2, 1], rows[2, 2] = -w * w * c, -w * w * n, u * u * d


class DepthConfig(PathTaskConfig):
    """Strokes along the path's z axis (`normal`) over a circle in its plane: a varying insertion depth.

    p(s) = (R (cos a - 1), R sin a, D (1 - cos b) / 2), a = 2 pi turns s, b = 2 pi strokes s. The lever
    between trocar and tip changes by D in every stroke, and with it what an error of the shaft does to the
    tip. Dimensions are assumed.
    """

    kernel: ClassVar[Any] = staticmethod(following(depth_path))

    type: Literal["depth"] = "depth"
    radius_m: NonNegativeFloat = 0.01
    turns: Turns = 2.0
    depth_m: PositiveFloat = 0.06
    strokes: Turns = 2.0

    @property
    def numbers(self) -> tuple[float, ...]:
        """The numbers of the path."""
        return (self.radius_m, self.turns, self.depth_m, self.strokes)
