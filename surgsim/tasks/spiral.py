"""Spiral (a helix): the pattern of a simple continuous suture."""

import math
from typing import Literal

import numpy as np
from pydantic import PositiveFloat

from surgsim.tasks.base import Array, PathTaskConfig, Turns


class SpiralConfig(PathTaskConfig):
    """Helix that advances along the path's z axis (`normal`).

    p(s) = (R (cos a - 1), R sin a, L s), a = 2 pi turns s. Default dimensions: Table 1 of the
    manipulability paper; the number of turns is not given there.
    """

    type: Literal["spiral"] = "spiral"
    radius_m: PositiveFloat = 0.01
    length_m: PositiveFloat = 0.05
    turns: Turns = 6.0

    def shape(self, s: float) -> Array:
        """Rows point and derivatives (3, 3) in path axes."""
        w, R, L = 2.0 * math.pi * self.turns, self.radius_m, self.length_m
        c, n = R * math.cos(w * s), R * math.sin(w * s)
        return np.array([[c - R, n, L * s], [-w * n, w * c, L], [-w * w * c, -w * w * n, 0.0]])
