"""Kinematics of the remote centre of motion: the shaft axis and the trocar point.

With the shaft's end at p (the tip, but for angled tips), unit shaft axis d, trocar C and r = p - C = s d + e,
the RCM error is e = (I - d d^T) r.
Its norm is the distance from the trocar to the axis, equal to the norm of eq. (2) of the VPRNN paper, and
s is the insertion depth. Two directions N (2, 3) normal to the shaft span it:

    e_N     = N r
    d/dt e  = N (Jv + s [d]x Jw) q' - N C'
    d2/dt2  = N (r'' - s d'' - 2 s' d')

A 3-row form through the cross product has rank 2 only; it is kept for the papers' literal equations.
"""

from dataclasses import dataclass

import numpy as np

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.models.arm import Kinematics
from surgsim.spatial import cross as cross_product
from surgsim.spatial import skew
from surgsim.tick.algebra import cross, dot, times
from surgsim.tick.scratch import scratch


@dataclass(frozen=True, slots=True, kw_only=True)
class Rcm:
    """RCM error and its Jacobian at one state.

    Attributes:
        error: e_N (2,) [m], in the directions `normals`.
        jacobian: J_rcm (2, n) [m/rad].
        trocar_velocity: N C' (2,) [m/s]; the error's rate is `jacobian @ v - trocar_velocity`.
        normals: N (2, 3), unit rows normal to the shaft.
        depth: Insertion depth s [m], negative while the shaft's end is outside the patient.
    """

    error: Array
    jacobian: Array
    trocar_velocity: Array
    normals: Array
    depth: float


def rcm_kinematics(kin: Kinematics, p_WC: Array, v_WC: Array) -> Rcm:
    """RCM error and Jacobian for a trocar at `p_WC` (3,) [m] moving at `v_WC` (3,) [m/s]."""
    n = kin.Jv_WT.shape[1]
    error, jacobian, velocity, normals = np.empty(2), np.empty((2, n)), np.empty(2), np.empty((2, 3))
    depth = fill_rcm(kin.p_WS, kin.R_WT, kin.Jv_WS, kin.Jw_WT, p_WC, v_WC, error, jacobian, velocity, normals)
    return Rcm(error=error, jacobian=jacobian, trocar_velocity=velocity, normals=normals, depth=depth)


@compiled
def fill_rcm(
    p: Array,
    R: Array,
    Jv: Array,
    Jw: Array,
    p_WC: Array,
    v_WC: Array,
    error: Array,
    jacobian: Array,
    velocity: Array,
    normals: Array,
) -> float:
    """Fill e_N (2,), J_rcm (2, n), N C' (2,) and N (2, 3) of the module's equations; the depth s [m]."""
    s = 0.0
    for i in range(3):
        s += R[i, 2] * (p[i] - p_WC[i])
        normals[0, i] = R[i, 0]
        normals[1, i] = R[i, 1]
    for k in range(2):
        e = rate = 0.0
        for i in range(3):
            e += normals[k, i] * (p[i] - p_WC[i])
            rate += normals[k, i] * v_WC[i]
        error[k], velocity[k] = e, rate
    # N [d]x has the rows n1 x d = -n2 and n2 x d = n1, since (n1, n2, d) is right-handed.
    for j in range(Jv.shape[1]):
        moved0 = moved1 = turned0 = turned1 = 0.0
        for i in range(3):
            moved0 += normals[0, i] * Jv[i, j]
            moved1 += normals[1, i] * Jv[i, j]
            turned0 += normals[0, i] * Jw[i, j]
            turned1 += normals[1, i] * Jw[i, j]
        jacobian[0, j] = moved0 - s * turned1
        jacobian[1, j] = moved1 + s * turned0
    return s


def rcm_bias_acceleration(
    kin: Kinematics, v: Array, p_WC: Array, v_WC: Array, linear: Array, angular: Array
) -> Array:
    """N d2e/dt2 at zero joint and trocar acceleration, (2,) [m/s^2]: J_rcm' q' of second-order laws.

    Args:
        kin: Kinematics.
        v: Joint velocities (n,) [rad/s].
        p_WC: Trocar position (3,) [m].
        v_WC: Trocar velocity (3,) [m/s].
        linear: Jv' v of the shaft's end (3,) [m/s^2].
        angular: Jw' v (3,) [rad/s^2].
    """
    out = np.empty(2)
    fill_rcm_bias(kin.p_WS, kin.R_WT, kin.Jv_WS, kin.Jw_WT, v, p_WC, v_WC, linear, angular, out)
    return out


@compiled
def fill_rcm_bias(
    p: Array,
    R: Array,
    Jv: Array,
    Jw: Array,
    v: Array,
    p_WC: Array,
    v_WC: Array,
    linear: Array,
    angular: Array,
    out: Array,
) -> None:
    """Fill `out` (2,) with N (r'' - s d'' - 2 s' d') at zero joint and trocar acceleration."""
    d, d_dot, d_ddot, turned = scratch(3), scratch(3), scratch(3), scratch(3)
    r, r_dot, omega = scratch(3), scratch(3), scratch(3)
    times(Jv, v, r_dot)
    times(Jw, v, omega)
    for i in range(3):
        d[i] = R[i, 2]
        r[i] = p[i] - p_WC[i]
        r_dot[i] -= v_WC[i]
    cross(omega, d, d_dot)
    cross(angular, d, d_ddot)
    cross(omega, d_dot, turned)
    depth, depth_rate = dot(d, r), dot(d_dot, r) + dot(d, r_dot)
    for k in range(2):
        s = 0.0
        for i in range(3):
            s += R[i, k] * (linear[i] - depth * (d_ddot[i] + turned[i]) - 2.0 * depth_rate * d_dot[i])
        out[k] = s


def rcm_cross_form(kin: Kinematics, p_WC: Array) -> tuple[Array, Array]:
    """E_rcm (3,) [m] of eq. (2) and its Jacobian (3, n), which has rank 2 on the constraint.

    E = (C - r_wrist) x (p - r_wrist) / |p - r_wrist| = d x (p - C), so dE = [d]x Jv + [r]x [d]x Jw.
    """
    d = kin.R_WT[:, 2]
    r = kin.p_WS - p_WC
    D = skew(d)
    return cross_product(d, r), D @ kin.Jv_WS + skew(r) @ D @ kin.Jw_WT
