"""Depth: the instrument goes in and out while its tip circles."""

import math
from typing import Literal

import numpy as np
from pydantic import NonNegativeFloat, PositiveFloat

from surgsim.tasks.base import Array, PathTaskConfig, Turns


class DepthConfig(PathTaskConfig):
    """Strokes along the path's z axis (`normal`) over a circle in its plane: a varying insertion depth.

    p(s) = (R (cos a - 1), R sin a, D (1 - cos b) / 2), a = 2 pi turns s, b = 2 pi strokes s. The lever
    between trocar and tip changes by D in every stroke, and with it what an error of the shaft does to the
    tip. Dimensions are assumed.
    """

    type: Literal["depth"] = "depth"
    radius_m: NonNegativeFloat = 0.01
    turns: Turns = 2.0
    depth_m: PositiveFloat = 0.06
    strokes: Turns = 2.0

    def shape(self, s: float) -> Array:
        """Rows point and derivatives (3, 3) in path axes."""
        w, u, R, D = (
            2.0 * math.pi * self.turns,
            2.0 * math.pi * self.strokes,
            self.radius_m,
            0.5 * self.depth_m,
        )
        c, n = R * math.cos(w * s), R * math.sin(w * s)
        d, m = D * math.cos(u * s), D * math.sin(u * s)
        return np.array([[c - R, n, D - d], [-w * n, w * c, u * m], [-w * w * c, -w * w * n, u * u * d]])
