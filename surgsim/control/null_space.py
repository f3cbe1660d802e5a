"""Velocity-level null-space tools, for Jacobians of full row rank."""

import numpy as np

from surgsim.array import Array
from surgsim.compiled import compiled


def least_velocity(J: Array, v: Array, qdot_0: Array | None = None) -> Array:
    """The solution of J q' = v nearest to `qdot_0` (n,) [rad/s]: q' = pinv(J) v + (I - pinv(J) J) q'_0.

    Raises:
        numpy.linalg.LinAlgError: If J has lost rank.
    """
    return _nearest(J, v, np.zeros(J.shape[1]) if qdot_0 is None else qdot_0)


@compiled
def _nearest(J: Array, v: Array, qdot_0: Array) -> Array:
    return qdot_0 + J.T @ np.linalg.solve(J @ J.T, v - J @ qdot_0)
