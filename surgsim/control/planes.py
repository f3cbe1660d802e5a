"""Virtual walls of the workspace."""

from collections.abc import Sequence
from typing import Self

import numpy as np
from numpy.typing import NDArray
from pydantic import FiniteFloat, model_validator

from surgsim.catalog import PartConfig
from surgsim.models.arm import Kinematics
from surgsim.models.config import Vec3

Array = NDArray[np.float64]


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


class Planes:
    """Rows n . J_T q' <= gain (offset - n . p), one for each wall: the tip comes to rest on it.

    Args:
        configs: The walls.
        gain_per_s: How fast the tip may approach a wall [1/s].
    """

    def __init__(self, configs: Sequence[PlaneConfig], gain_per_s: float) -> None:
        self._normals = np.array([plane.normal for plane in configs], dtype=float).reshape(-1, 3)
        self._normals /= np.linalg.norm(self._normals, axis=1, keepdims=True)
        self._offsets = np.array([plane.offset_m for plane in configs])
        self._gain = gain_per_s

    def __len__(self) -> int:
        return len(self._offsets)

    def rows(self, kin: Kinematics) -> tuple[Array, Array]:
        """Rows (n, 7) and their upper bounds (n,) [m/s]."""
        return self._normals @ kin.Jv_WT, self._gain * (self._offsets - self._normals @ kin.p_WT)
