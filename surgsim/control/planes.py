"""Virtual walls of the workspace."""

import math
from collections.abc import Sequence
from typing import Self

import numpy as np
from pydantic import FiniteFloat, model_validator

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.models.config import Vec3
from surgsim.tick.arrays import Seen


class PlaneConfig(PartConfig):
    """Virtual wall that the tip must not pass.

    Attributes:
        normal: Direction out of the allowed side.
        offset_m: The allowed side is normal . p <= offset_m, with the normal scaled to length one [m].
    """

    normal: Vec3
    offset_m: FiniteFloat

    @model_validator(mode="after")
    def _normal_is_a_direction(self) -> Self:
        if not any(self.normal):
            raise ValueError("normal must not be zero")
        return self


def plane_numbers(configs: Sequence[PlaneConfig]) -> Array:
    """Walls as `fill_plane_rows` takes them: of each its unit normal and offset [m], in a row (4 k,)."""
    numbers: list[float] = []
    for plane in configs:
        length = math.sqrt(sum(x * x for x in plane.normal))
        numbers += [*(x / length for x in plane.normal), plane.offset_m]
    return np.array(numbers, dtype=np.float64)


@compiled
def fill_plane_rows(planes: Array, gain: float, seen: Seen, G: Array, most: Array) -> None:
    """Rows n . J_T q' <= gain (offset - n . p), one for each wall: the tip comes to rest on it.

    Args:
        planes: The walls, from `plane_numbers` (4 k,).
        gain: How fast the tip may approach a wall [1/s].
        seen: Tip and Jacobian.
        G: Rows, of which the first n columns are filled (k, n or more).
        most: Filled with their upper bounds (k,) [m/s].
    """
    for k in range(most.size):
        room = planes[4 * k + 3]
        for i in range(3):
            room -= planes[4 * k + i] * seen.p_WT[i]
        most[k] = gain * room
        for j in range(seen.q.size):
            s = 0.0
            for i in range(3):
                s += planes[4 * k + i] * seen.Jv_WT[i, j]
            G[k, j] = s
