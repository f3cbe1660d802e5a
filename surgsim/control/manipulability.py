"""Yoshikawa's manipulability, its gradient, and the papers' diamond operator.

For a chain of revolute joints with axes z_i and translational Jacobian columns J_j,

    dJ_j/dq_i = z_min(i,j) x J_max(i,j)

so no finite differences are needed.
"""

import math

import numpy as np

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.models.arm import Kinematics
from surgsim.tick.algebra import back_substitute_rows, determinant, dot, factor, outer_product
from surgsim.tick.arrays import Model
from surgsim.tick.nominal import kinematics
from surgsim.tick.scratch import scratch, scratch_matrix


@compiled
def manipulability(J: Array) -> float:
    """Mu = sqrt(det(J J^T)) of a Jacobian (m, n); eq. (5) of the VPRNN paper."""
    A = np.empty((J.shape[0], J.shape[0]))
    outer_product(J, J, A)
    return math.sqrt(max(determinant(A), 0.0))


@compiled
def jacobian_gradient(J: Array, z: Array) -> Array:
    """Derivative of the translational Jacobian: H (n, 3, n) with H[i] = dJ/dq_i [m/rad^2].

    Args:
        J: Translational Jacobian (3, n) [m/rad].
        z: Joint axes as rows (n, 3).
    """
    n = J.shape[1]
    H = np.empty((n, 3, n))
    for i in range(n):
        fill_jacobian_gradient(J, z, i, H[i])
    return H


@compiled
def fill_jacobian_gradient(J: Array, z: Array, i: int, out: Array) -> None:
    """Fill dJ/dq_i (3, n) of the translational Jacobian."""
    for j in range(J.shape[1]):
        a, b = min(i, j), max(i, j)
        out[0, j] = z[a, 1] * J[2, b] - z[a, 2] * J[1, b]
        out[1, j] = z[a, 2] * J[0, b] - z[a, 0] * J[2, b]
        out[2, j] = z[a, 0] * J[1, b] - z[a, 1] * J[0, b]


@compiled
def diamond(J: Array, H: Array) -> Array:
    """J <> h = [vec(J h_i^T)^T]_i (n, 9); eq. (18) of the VPRNN paper, column-major vec."""
    D = np.empty((J.shape[1], 9))
    for i in range(J.shape[1]):
        _diamond_row(J, H[i], D[i])
    return D


@compiled
def fill_diamond(J: Array, z: Array, D: Array) -> None:
    """Fill J <> H (n, 9) with the derivatives H of the translational Jacobian, see `jacobian_gradient`."""
    h = scratch_matrix(3, J.shape[1])
    for i in range(J.shape[1]):
        fill_jacobian_gradient(J, z, i, h)
        _diamond_row(J, h, D[i])


@compiled
def fill_diamond_product(J: Array, z: Array, X: Array, out: Array) -> None:
    """Fill (J <> H) psi (n,) with psi[3 b + a] = X[b, a], without the matrix: tr(dJ/dq_i J^T X^T)."""
    n = J.shape[1]
    h, Y = scratch_matrix(3, n), scratch_matrix(3, n)
    for b in range(3):
        for c in range(n):
            Y[b, c] = X[b, 0] * J[0, c] + X[b, 1] * J[1, c] + X[b, 2] * J[2, c]
    for i in range(n):
        fill_jacobian_gradient(J, z, i, h)
        s = 0.0
        for b in range(3):
            for c in range(n):
                s += h[b, c] * Y[b, c]
        out[i] = s


@compiled
def _diamond_row(J: Array, h: Array, out: Array) -> None:
    for b in range(3):
        for a in range(3):
            s = 0.0
            for c in range(J.shape[1]):
                s += J[a, c] * h[b, c]
            out[3 * b + a] = s


@compiled
def fill_log_manipulability_gradient(J: Array, z: Array, out: Array) -> bool:
    """Gradient of ln(mu) of the translational Jacobian, `out` (n,) [1/rad]; False if J has lost rank.

        d(ln mu)/dq_i = tr(dJ/dq_i J^T (J J^T)^-1) = z_i . sum_{j>=i} J_j x B_j + J_i . sum_{j<i} B_j x z_j

    with the rows B_j = (J J^T)^-1 J_j. Equal to (J <> h) psi with psi = vec((J J^T)^-1).
    """
    columns, B = scratch_matrix(J.shape[1], 3), scratch_matrix(J.shape[1], 3)
    if not fill_weighted_columns(J, columns, B):
        return False
    fill_gradient(columns, z, B, out)
    return True


@compiled
def fill_weighted_columns(J: Array, columns: Array, B: Array) -> bool:
    """Rows J_j (n, 3) of J (3, n), and rows B_j = (J J^T)^-1 J_j (n, 3); False if J has lost rank."""
    A, inverse = scratch_matrix(3, 3), scratch_matrix(3, 3)
    inverse[:] = 0.0
    outer_product(J, J, A)
    if not factor(A):
        return False
    for a in range(3):
        inverse[a, a] = 1.0
    back_substitute_rows(A, inverse)
    for j in range(J.shape[1]):
        for a in range(3):
            columns[j, a] = J[a, j]
            B[j, a] = inverse[a, 0] * J[0, j] + inverse[a, 1] * J[1, j] + inverse[a, 2] * J[2, j]
    return True


@compiled
def fill_gradient(J: Array, z: Array, B: Array, out: Array) -> None:
    """Fill the gradient of ln(mu) (n,) from rows J_j, z_j and B_j (n, 3), see above."""
    below, above = scratch_matrix(1, 3), scratch_matrix(1, 3)
    below[:], above[:] = 0.0, 0.0
    for i in range(out.size):
        out[i] = _dot(J, i, below, 0)
        _add_cross(B, i, z, i, below, 0)
    for i in range(out.size - 1, -1, -1):
        _add_cross(J, i, B, i, above, 0)
        out[i] += _dot(z, i, above, 0)


@compiled
def fill_chain_slope(J: Array, z: Array, way: Array, dJ: Array, dz: Array, tip: Array) -> None:
    """Derivatives along `way` (n,) of a revolute chain's rows J_j and z_j (n, 3), and of its tip.

        dz_j = w_j x z_j,   dJ_j = w_j x J_j + z_j x sum_{i>j} way_i J_i,   w_j = sum_{i<=j} way_i z_i

    Rows of `tip` (2, 3): its displacement and its turn, each by `way`.
    """
    n = way.size
    tip[:] = 0.0
    dJ[:] = 0.0
    dz[:] = 0.0
    for j in range(n):
        for a in range(3):
            tip[1, a] += way[j] * z[j, a]
        _add_cross(tip, 1, z, j, dz, j)
        _add_cross(tip, 1, J, j, dJ, j)
    for j in range(n - 1, -1, -1):
        _add_cross(z, j, tip, 0, dJ, j)
        for a in range(3):
            tip[0, a] += way[j] * J[j, a]


@compiled
def fill_gradient_slope(J: Array, z: Array, B: Array, dJ: Array, dz: Array, out: Array) -> None:
    """Derivative of the gradient of ln(mu), `out` (n,), where the rows J_j and z_j change by dJ_j and dz_j.

    The product rule on `fill_gradient`, with dB_j = A^-1 (dJ_j - dA B_j), A = J J^T and A^-1 = sum B_j B_j^T.
    """
    n = out.size
    dA, inverse, dB, gap = scratch_matrix(3, 3), scratch_matrix(3, 3), scratch_matrix(n, 3), scratch(3)
    dA[:], inverse[:] = 0.0, 0.0
    for j in range(n):
        for a in range(3):
            for b in range(3):
                dA[a, b] += dJ[j, a] * J[j, b] + J[j, a] * dJ[j, b]
                inverse[a, b] += B[j, a] * B[j, b]
    for j in range(n):
        for a in range(3):
            gap[a] = dJ[j, a] - dA[a, 0] * B[j, 0] - dA[a, 1] * B[j, 1] - dA[a, 2] * B[j, 2]
        for a in range(3):
            dB[j, a] = inverse[a, 0] * gap[0] + inverse[a, 1] * gap[1] + inverse[a, 2] * gap[2]
    below, above = scratch_matrix(2, 3), scratch_matrix(2, 3)  # the sums, and their derivatives
    below[:], above[:] = 0.0, 0.0
    for i in range(n):
        out[i] = _dot(dJ, i, below, 0) + _dot(J, i, below, 1)
        _add_cross(B, i, z, i, below, 0)
        _add_cross(dB, i, z, i, below, 1)
        _add_cross(B, i, dz, i, below, 1)
    for i in range(n - 1, -1, -1):
        _add_cross(J, i, B, i, above, 0)
        _add_cross(dJ, i, B, i, above, 1)
        _add_cross(J, i, dB, i, above, 1)
        out[i] += _dot(dz, i, above, 0) + _dot(z, i, above, 1)


@compiled
def _dot(A: Array, i: int, B: Array, j: int) -> float:
    """Product of row i of A and row j of B, each of three."""
    product: float = A[i, 0] * B[j, 0] + A[i, 1] * B[j, 1] + A[i, 2] * B[j, 2]
    return product


@compiled
def _add_cross(A: Array, i: int, B: Array, j: int, out: Array, k: int) -> None:
    """Row k of `out` += row i of A x row j of B."""
    x = A[i, 1] * B[j, 2] - A[i, 2] * B[j, 1]
    y = A[i, 2] * B[j, 0] - A[i, 0] * B[j, 2]
    w = A[i, 0] * B[j, 1] - A[i, 1] * B[j, 0]
    out[k, 0] += x
    out[k, 1] += y
    out[k, 2] += w


def log_manipulability_gradient(J: Array, z: Array) -> Array:
    """Gradient of ln(mu) of the translational Jacobian, (n,) [1/rad].

    Raises:
        numpy.linalg.LinAlgError: If J has lost rank.
    """
    gradient = np.empty(J.shape[1])
    if not fill_log_manipulability_gradient(np.ascontiguousarray(J), np.ascontiguousarray(z), gradient):
        raise np.linalg.LinAlgError("Singular matrix")
    return gradient


def velocity_product_accelerations(kin: Kinematics, v: Array) -> tuple[Array, Array]:
    """Jv' v and Jw' v at joint velocities `v` (n,) [rad/s]: tip and angular acceleration, each (3,)."""
    linear, angular = np.empty(3), np.empty(3)
    fill_velocity_products(kin.Jv_WT, kin.z_W, v, linear, angular)
    return linear, angular


@compiled
def fill_velocity_products(J: Array, z: Array, v: Array, linear: Array, angular: Array) -> None:
    """Fill Jv' v and Jw' v, each (3,).

    Jv' v = sum_ij dJ_j/dq_i v_i v_j with dJ_j/dq_i = z_min(i,j) x J_max(i,j), and
    Jw' v = sum_{i<j} z_i x z_j v_i v_j, for revolute joints.
    """
    linear[:] = 0.0
    angular[:] = 0.0
    n = v.size
    for i in range(n):
        for j in range(i, n):
            w = v[i] * v[j] if i == j else 2.0 * v[i] * v[j]
            linear[0] += w * (z[i, 1] * J[2, j] - z[i, 2] * J[1, j])
            linear[1] += w * (z[i, 2] * J[0, j] - z[i, 0] * J[2, j])
            linear[2] += w * (z[i, 0] * J[1, j] - z[i, 1] * J[0, j])
        for j in range(i + 1, n):
            w = v[i] * v[j]
            angular[0] += w * (z[i, 1] * z[j, 2] - z[i, 2] * z[j, 1])
            angular[1] += w * (z[i, 2] * z[j, 0] - z[i, 0] * z[j, 2])
            angular[2] += w * (z[i, 0] * z[j, 1] - z[i, 1] * z[j, 0])


@compiled
def manipulabilities(model: Model, q: Array) -> tuple[float, float]:
    """Manipulability of the translational and the whole tip Jacobian at `q` (n,) [rad]; NaN if `q` is.

    Mu = sqrt(det(J J^T)), with J (3, n) and (6, n).
    """
    if not math.isfinite(dot(q, q)):
        return math.nan, math.nan
    kinematics(model, q)
    Jv, Jw = model.Jv_WT, model.Jw_WT
    A, B, whole = scratch_matrix(3, 3), scratch_matrix(3, 3), scratch_matrix(6, 6)
    outer_product(Jv, Jv, A)
    whole[:3, :3] = A
    outer_product(Jw, Jv, B)
    whole[3:, :3] = B
    whole[:3, 3:] = B.T
    outer_product(Jw, Jw, B)
    whole[3:, 3:] = B
    return math.sqrt(max(determinant(A), 0.0)), math.sqrt(max(determinant(whole), 0.0))
