"""Yoshikawa's manipulability, its gradient, and the papers' diamond operator.

For a chain of revolute joints with axes z_i and translational Jacobian columns J_j,

    dJ_j/dq_i = z_min(i,j) x J_max(i,j)

so no finite differences are needed.
"""

import numpy as np
from numpy.typing import NDArray

from surgsim.compiled import compiled
from surgsim.models.arm import ArmModel, Kinematics

Array = NDArray[np.float64]


def manipulability(J: Array) -> float:
    """Mu = sqrt(det(J J^T)) of a Jacobian (m, n); eq. (5) of the VPRNN paper."""
    return float(np.sqrt(max(np.linalg.det(J @ J.T), 0.0)))


@compiled
def jacobian_gradient(J: Array, z: Array) -> Array:
    """Derivative of the translational Jacobian: H (7, 3, 7) with H[i] = dJ/dq_i [m/rad^2].

    Args:
        J: Translational Jacobian (3, 7) [m/rad].
        z: Joint axes as rows (7, 3).
    """
    H = np.empty((7, 3, 7))
    for i in range(7):
        for j in range(i, 7):
            x = z[i, 1] * J[2, j] - z[i, 2] * J[1, j]
            y = z[i, 2] * J[0, j] - z[i, 0] * J[2, j]
            w = z[i, 0] * J[1, j] - z[i, 1] * J[0, j]
            H[i, 0, j] = H[j, 0, i] = x
            H[i, 1, j] = H[j, 1, i] = y
            H[i, 2, j] = H[j, 2, i] = w
    return H


@compiled
def diamond(J: Array, H: Array) -> Array:
    """J <> h = [vec(J h_i^T)^T]_i (7, 9); eq. (18) of the VPRNN paper, column-major vec."""
    D = np.zeros((7, 9))
    for i in range(7):
        for b in range(3):
            for a in range(3):
                for c in range(7):
                    D[i, 3 * b + a] += J[a, c] * H[i, b, c]
    return D


@compiled
def log_manipulability_gradient(J: Array, z: Array) -> Array:
    """Gradient of ln(mu) of the translational Jacobian, (7,) [1/rad].

    d(ln mu)/dq_i = tr(dJ/dq_i J^T (J J^T)^-1), equal to (J <> h) psi with psi = vec((J J^T)^-1).

    Raises:
        numpy.linalg.LinAlgError: If J has lost rank.
    """
    B = np.linalg.solve(J @ J.T, J)
    H = jacobian_gradient(J, z)
    gradient = np.zeros(7)
    for i in range(7):
        for a in range(3):
            for b in range(7):
                gradient[i] += B[a, b] * H[i, a, b]
    return gradient


def velocity_product_accelerations(kin: Kinematics, v: Array) -> tuple[Array, Array]:
    """Jv' v and Jw' v at joint velocities `v` (7,) [rad/s]: tip and angular acceleration, each (3,).

    Jv' v = sum_ij dJ_j/dq_i v_i v_j, and Jw' v = sum_{i<j} z_i x z_j v_i v_j for revolute joints.
    """
    return _velocity_products(kin.Jv_WT, kin.z_W, v)


@compiled
def _velocity_products(J: Array, z: Array, v: Array) -> tuple[Array, Array]:
    linear, angular = np.zeros(3), np.zeros(3)
    H = jacobian_gradient(J, z)
    for i in range(7):
        for j in range(7):
            for a in range(3):
                linear[a] += H[i, a, j] * v[i] * v[j]
        for j in range(i + 1, 7):
            w = v[i] * v[j]
            angular[0] += w * (z[i, 1] * z[j, 2] - z[i, 2] * z[j, 1])
            angular[1] += w * (z[i, 2] * z[j, 0] - z[i, 0] * z[j, 2])
            angular[2] += w * (z[i, 0] * z[j, 1] - z[i, 1] * z[j, 0])
    return linear, angular


def manipulability_series(arm: ArmModel, q: Array) -> tuple[Array, Array]:
    """Manipulability along joint positions `q` (n, 7): of the 3x7 and the 6x7 tip Jacobian, each (n,)."""
    finite = np.asarray(np.isfinite(q).all(axis=1))
    J = arm.jacobians(np.where(finite[:, None], q, 0.0))
    squares = np.linalg.det(J[:, :3] @ J[:, :3].transpose(0, 2, 1)), np.linalg.det(J @ J.transpose(0, 2, 1))
    translational, whole = (np.where(finite, np.sqrt(np.maximum(s, 0.0)), np.nan) for s in squares)
    return translational, whole
