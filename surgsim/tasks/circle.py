"""Circle: a circular cut, e.g. around a tumour."""

import math
from typing import Literal

import numpy as np
from pydantic import PositiveFloat

from surgsim.tasks.base import Array, PathTaskConfig, Turns


class CircleConfig(PathTaskConfig):
    """Circle in the path's plane, beginning at its point furthest along the path's x axis.

    p(s) = R (cos a - 1, sin a, 0), a = 2 pi turns s. Default dimensions: Table 1 of the manipulability
    paper.
    """

    type: Literal["circle"] = "circle"
    radius_m: PositiveFloat = 0.02
    turns: Turns = 1.0

    def shape(self, s: float) -> Array:
        """Rows point and derivatives (3, 3) in path axes."""
        w, R = 2.0 * math.pi * self.turns, self.radius_m
        c, n = R * math.cos(w * s), R * math.sin(w * s)
        return np.array([[c - R, n, 0.0], [-w * n, w * c, 0.0], [-w * w * c, -w * w * n, 0.0]])
