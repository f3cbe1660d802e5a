"""Sinusoid: a wavy incision such as the coronal one."""

import math
from typing import Literal

import numpy as np
from pydantic import PositiveFloat

from surgsim.tasks.base import Array, PathTaskConfig, Turns


class SinusoidConfig(PathTaskConfig):
    """Sine wave along the path's x axis with its amplitude along y.

    p(s) = (L s, A sin(2 pi periods s), 0). Default dimensions: Table 1 of the manipulability paper; the
    number of periods is not given there.
    """

    type: Literal["sinusoid"] = "sinusoid"
    amplitude_m: PositiveFloat = 0.01
    length_m: PositiveFloat = 0.25
    periods: Turns = 2.0

    def shape(self, s: float) -> Array:
        """Rows point and derivatives (3, 3) in path axes."""
        w, A, L = 2.0 * math.pi * self.periods, self.amplitude_m, self.length_m
        c, n = A * math.cos(w * s), A * math.sin(w * s)
        return np.array([[L * s, n, 0.0], [L, w * c, 0.0], [0.0, -w * w * n, 0.0]])
