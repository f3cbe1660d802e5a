"""The screw from the tip to a place, and how it changes with the joints.

With R = R_WT and the place p_t, (e_v, w) = log(T_WT^-1 T_Wt) leads from the tip to a frame at p_t that is
parallel to the world's. Its translational part and Jacobian are

    e_v = A(w) R^T (p_t - p_WT),    J_v = -(A R^T Jv - A Q(e_v, w) A R^T Jw)

with the inverse left Jacobian A of SO(3). It ends where the difference p_t - p_WT does, on another way: a
redundant arm comes there with other joints.

Source: Solà, Deray and Atchuthan, "A micro Lie theory for state estimation in robotics",
eqs. 174, 179 and 180.
"""

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.spatial import skew


def tip_error(p_t: Array, p_WT: Array, R_WT: Array, Jv_WT: Array, Jw_WT: Array) -> tuple[Array, Array]:
    """e_v (3,) [m] and J_v (3, n) [m/rad] of the module's equations.

    Args:
        p_t: Where the tip shall be (3,) [m].
        p_WT: Where it is (3,) [m].
        R_WT: Its orientation (3, 3).
        Jv_WT: Its translational Jacobian (3, n) [m/rad].
        Jw_WT: Its rotational Jacobian (3, n) [-].
    """
    w = rotation_vector(R_WT.T)
    A = _inverse_left_jacobian(w)
    error = A @ (R_WT.T @ (p_t - p_WT))
    turned = A @ _Q(error, w) @ A
    return error, -(A @ (R_WT.T @ Jv_WT) - turned @ (R_WT.T @ Jw_WT))


def rotation_vector(R: Array) -> Array:
    """Axis times angle (3,) [rad] of a rotation matrix (3, 3), the angle at most pi."""
    quaternion, w = np.zeros(4), np.zeros(3)
    mujoco.mju_mat2Quat(quaternion, R.reshape(9))
    mujoco.mju_quat2Vel(w, quaternion, 1.0)
    return w


def _inverse_left_jacobian(w: Array) -> Array:
    """A (3, 3) for a rotation vector (3,) [rad]."""
    angle = float(np.linalg.norm(w))
    W = skew(w)
    beta = 1.0 / 12.0
    if angle >= 1e-5:
        beta = (1.0 - 0.5 * angle / np.tan(0.5 * angle)) / angle**2
    return np.asarray(np.eye(3) - 0.5 * W + beta * (W @ W))


def _Q(v: Array, w: Array) -> Array:
    """Q (3, 3) [m] of a screw: translation `v` (3,) [m], rotation `w` (3,) [rad]."""
    t = float(np.linalg.norm(w))
    if t < 1e-5:
        b, c, d = 1.0 / 6.0, -1.0 / 24.0, 1.0 / 120.0
    else:
        s, k = np.sin(t), np.cos(t)
        b = (t - s) / t**3
        c = (1.0 - 0.5 * t**2 - k) / t**4
        d = (2.0 * t - 3.0 * s + t * k) / (2.0 * t**5)
    V, W = skew(v), skew(w)
    WVW, VWW = W @ V @ W, V @ W @ W
    return np.asarray(
        0.5 * V + b * (W @ V + V @ W + WVW) - c * (VWW - VWW.T - 3.0 * WVW) + d * (WVW @ W + W @ WVW)
    )
