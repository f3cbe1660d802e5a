"""Kinematics of the remote centre of motion: the shaft axis and the trocar point.

With tip position p, unit shaft axis d, trocar C and r = p - C = s d + e, the RCM error is e = (I - d d^T) r.
Its norm is the distance from the trocar to the axis, equal to the norm of eq. (2) of the VPRNN paper, and
s is the insertion depth. Two directions N (2, 3) normal to the shaft span it:

    e_N     = N r
    d/dt e  = N (Jv + s [d]x Jw) q' - N C'
    d2/dt2  = N (r'' - s d'' - 2 s' d')

A 3-row form through the cross product has rank 2 only; it is kept for the papers' literal equations.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from surgsim.compiled import compiled
from surgsim.models.arm import Kinematics
from surgsim.spatial import cross, skew

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Rcm:
    """RCM error and its Jacobian at one state.

    Attributes:
        error: e_N (2,) [m], in the directions `normals`.
        jacobian: J_rcm (2, 7) [m/rad].
        trocar_velocity: N C' (2,) [m/s]; the error's rate is `jacobian @ v - trocar_velocity`.
        normals: N (2, 3), unit rows normal to the shaft.
        depth: Insertion depth s [m], negative while the tip is outside the patient.
    """

    error: Array
    jacobian: Array
    trocar_velocity: Array
    normals: Array
    depth: float


def rcm_kinematics(kin: Kinematics, p_WC: Array, v_WC: Array) -> Rcm:
    """RCM error and Jacobian for a trocar at `p_WC` (3,) [m] moving at `v_WC` (3,) [m/s]."""
    error, jacobian, trocar_velocity, normals, depth = _rcm(
        kin.p_WT, kin.R_WT, kin.Jv_WT, kin.Jw_WT, p_WC, v_WC
    )
    return Rcm(error=error, jacobian=jacobian, trocar_velocity=trocar_velocity, normals=normals, depth=depth)


@compiled
def _rcm(
    p: Array, R: Array, Jv: Array, Jw: Array, p_WC: Array, v_WC: Array
) -> tuple[Array, Array, Array, Array, float]:
    N = np.ascontiguousarray(R[:, :2].T)
    r = p - p_WC
    depth = R[0, 2] * r[0] + R[1, 2] * r[1] + R[2, 2] * r[2]
    # N [d]x has the rows n1 x d = -n2 and n2 x d = n1, since (n1, n2, d) is right-handed.
    J = N @ Jv
    turn = N @ Jw
    J[0] -= depth * turn[1]
    J[1] += depth * turn[0]
    return N @ r, J, N @ v_WC, N, depth


def rcm_bias_acceleration(
    kin: Kinematics, v: Array, p_WC: Array, v_WC: Array, linear: Array, angular: Array
) -> Array:
    """N d2e/dt2 at zero joint and trocar acceleration, (2,) [m/s^2]: J_rcm' q' of second-order laws.

    Args:
        kin: Kinematics.
        v: Joint velocities (7,) [rad/s].
        p_WC: Trocar position (3,) [m].
        v_WC: Trocar velocity (3,) [m/s].
        linear: Jv' v (3,) [m/s^2].
        angular: Jw' v (3,) [rad/s^2].
    """
    return _bias(kin.p_WT, kin.R_WT, kin.Jv_WT, kin.Jw_WT, v, p_WC, v_WC, linear, angular)


@compiled
def _bias(
    p: Array,
    R: Array,
    Jv: Array,
    Jw: Array,
    v: Array,
    p_WC: Array,
    v_WC: Array,
    linear: Array,
    angular: Array,
) -> Array:
    d = np.ascontiguousarray(R[:, 2])
    r = p - p_WC
    r_dot = Jv @ v - v_WC
    omega = Jw @ v
    d_dot = np.cross(omega, d)
    d_ddot = np.cross(angular, d) + np.cross(omega, d_dot)
    depth_rate = d_dot @ r + d @ r_dot
    return np.ascontiguousarray(R[:, :2].T) @ (linear - (d @ r) * d_ddot - 2.0 * depth_rate * d_dot)


def rcm_cross_form(kin: Kinematics, p_WC: Array) -> tuple[Array, Array]:
    """E_rcm (3,) [m] of eq. (2) and its Jacobian (3, 7), which has rank 2 on the constraint.

    E = (C - r_wrist) x (p - r_wrist) / |p - r_wrist| = d x (p - C), so dE = [d]x Jv + [r]x [d]x Jw.
    """
    d = kin.R_WT[:, 2]
    r = kin.p_WT - p_WC
    D = skew(d)
    return cross(d, r), D @ kin.Jv_WT + skew(r) @ D @ kin.Jw_WT
