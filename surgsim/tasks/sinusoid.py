"""Sinusoid: a wavy incision such as the coronal one."""

import math
from typing import Any, ClassVar, Literal

from pydantic import PositiveFloat

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.tasks.base import PathTaskConfig, Turns, following


@compiled
def sinusoid_path(numbers: Array, s: float, rows: Array) -> None:
    """Rows point and derivatives (3, 3) in path axes."""
    A, L, w = numbers[0], numbers[1], 2.0 * math.pi * numbers[2]
    c, n = A * math.cos(w * s), A * math.sin(w * s)
    rows[:] = 0.0
    rows[0, 0], rows[0, 1] = L * s, n
    rows[1, 0], rows[1, 1] = L, w * c
    rows[2, 1] = -w * w * n


class SinusoidConfig(PathTaskConfig):
    """Sine wave along the path's x axis with its amplitude along y.

    p(s) = (L s, A sin(2 pi periods s), 0). Default dimensions: Table 1 of the manipulability paper; the
    number of periods is not given there.
    """

    kernel: ClassVar[Any] = staticmethod(following(sinusoid_path))

    type: Literal["sinusoid"] = "sinusoid"
    amplitude_m: PositiveFloat = 0.01
    length_m: PositiveFloat = 0.25
    periods: Turns = 2.0

    @property
    def numbers(self) -> tuple[float, ...]:
        """The numbers of the path."""
        return (self.amplitude_m, self.length_m, self.periods)
