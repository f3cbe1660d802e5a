"""Alignment of the console with the remote world, and the force law written in it."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import PositiveFloat, model_validator

from surgsim.catalog import PartConfig

Array = NDArray[np.float64]


class MappingConfig(PartConfig):
    """Motion scaling and rotation between console and remote world.

    `scale` is remote motion over handle motion; `rotation_wxyz` turns console axes O into world axes W.
    """

    scale: PositiveFloat = 0.5
    rotation_wxyz: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _quaternion_is_unit(self) -> Self:
        norm = float(np.linalg.norm(self.rotation_wxyz))
        if abs(norm - 1.0) > 1e-6:
            raise ValueError(f"rotation_wxyz must have norm 1, not {norm:g}")
        return self


def rotation_matrix(wxyz: ArrayLike) -> Array:
    """Rotation matrix (3, 3) of a unit quaternion (w, x, y, z)."""
    w, x, y, z = (float(value) for value in np.asarray(wxyz))
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


@dataclass(frozen=True, kw_only=True)
class Mapping:
    """p_W = home_W + s R_WO (p_O - home_O).

    Attributes:
        scale: s, remote motion over handle motion.
        R_WO: Console axes in the world (3, 3).
        home_O: Handle position that belongs to `home_W` (3,) [m].
        home_W: Remote tip position that belongs to `home_O` (3,) [m].
    """

    scale: float
    R_WO: Array
    home_O: Array
    home_W: Array

    @classmethod
    def aligned(cls, config: MappingConfig, home_O: ArrayLike, home_W: ArrayLike) -> Self:
        """Mapping in which the handle at `home_O` stands for the tip at `home_W`."""
        return cls(
            scale=config.scale,
            R_WO=rotation_matrix(config.rotation_wxyz),
            home_O=np.array(home_O, dtype=float),
            home_W=np.array(home_W, dtype=float),
        )

    def to_remote(self, p_O: Array) -> Array:
        """Tip position (3,) for a handle position (3,)."""
        return self.home_W + self.scale * (self.R_WO @ (p_O - self.home_O))

    def to_console(self, p_W: Array) -> Array:
        """Handle position (3,) for a tip position (3,)."""
        return self.home_O + ((p_W - self.home_W) @ self.R_WO) / self.scale

    def motion_to_remote(self, v_O: Array) -> Array:
        """Remote displacement or velocity s R_WO v_O (3,)."""
        return np.asarray(self.scale * (self.R_WO @ v_O))

    def motion_to_console(self, v_W: Array) -> Array:
        """Handle displacement or velocity R_OW v_W / s (3,)."""
        return np.asarray((v_W @ self.R_WO) / self.scale)


def feedback_force(mapping: Mapping, p_handle_O: Array, p_tip_W: Array, stiffness_n_per_m: float) -> Array:
    """Force on the handle in console axes (3,) [N]: F = K_v (x_r(t - delta) - x_o(t)).

    Args:
        mapping: Brings the tip into the console.
        p_handle_O: Handle position x_o (3,) [m].
        p_tip_W: Remote tip position as last received, x_r(t - delta) (3,) [m].
        stiffness_n_per_m: K_v, per metre of handle motion.

    Source:
        Section 2.2 of the passive teleoperation paper (10.1002/rnc.7613); the joint torques follow as J^T F.
    """
    return np.asarray(stiffness_n_per_m * (mapping.to_console(p_tip_W) - p_handle_O))
