"""Hierarchical impedance: tip, then RCM, then joint compliance, each in the null space of those above."""

from typing import Literal, Self

import numpy as np
from pydantic import NonNegativeFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.control.torque_laws.base import KernelTorqueLaw, with_lists
from surgsim.models.arm import ArmModel
from surgsim.models.config import PerJoint, Vec3
from surgsim.tick.algebra import (
    back_substitute,
    back_substitute_rows,
    dot,
    factor,
    outer_product,
    times,
    transposed_times,
)
from surgsim.tick.arrays import Seen
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.status import GOES_ON, RANK_LOST

TABLE_I_STIFFNESS = (80.0, 120.0, 60.0, 30.0, 20.0, 10.0, 10.0)
"""K_N2 of Table I of the VPRNN paper, from base to flange [N m/rad]."""
TABLE_I_DAMPING = (6.0, 10.0, 5.0, 3.0, 2.0, 1.0, 1.0)
"""K_D2 of the same table [N m s/rad]."""


class HierarchicalImpedanceConfig(PartConfig):
    """Cartesian compliance of the tip, RCM compliance in its null space, joint compliance below both.

    Attributes:
        tip_stiffness_n_per_m: K_X, diagonal.
        tip_damping_n_s_per_m: D_X, diagonal.
        rcm_stiffness_n_per_m: K_N.
        rcm_damping_n_s_per_m: D_N.
        joint_stiffness_nm_per_rad: K_N2, diagonal; null: Table I's from base to flange, read off at the arm's
            joints.
        joint_damping_nm_s_per_rad: D_N2 (K_D2 in Table I), diagonal; null: likewise.
    """

    type: Literal["hierarchical_impedance"] = "hierarchical_impedance"
    tip_stiffness_n_per_m: Vec3 = (3000.0, 3000.0, 3000.0)
    tip_damping_n_s_per_m: Vec3 = (30.0, 30.0, 30.0)
    rcm_stiffness_n_per_m: NonNegativeFloat = 800.0
    rcm_damping_n_s_per_m: NonNegativeFloat = 10.0
    joint_stiffness_nm_per_rad: PerJoint | None = None
    joint_damping_nm_s_per_rad: PerJoint | None = None

    def written_out(self, joints: int) -> Self:
        """The same law with both lists of the joints (joints,).

        Raises:
            SurgsimError: If a list has not a number for each joint.
        """
        defaults = {
            "joint_stiffness_nm_per_rad": TABLE_I_STIFFNESS,
            "joint_damping_nm_s_per_rad": TABLE_I_DAMPING,
        }
        return with_lists(self, defaults, joints)

    def build(self, arm: ArmModel) -> KernelTorqueLaw:
        """The law; gains K_X (3,), D_X (3,), K_N, D_N, K_N2 (n,), D_N2 (n,).

        Raises:
            SurgsimError: If a list has not a number for each joint.
        """
        whole = self.written_out(arm.limits.q_min.size)
        gains = [
            *self.tip_stiffness_n_per_m,
            *self.tip_damping_n_s_per_m,
            self.rcm_stiffness_n_per_m,
            self.rcm_damping_n_s_per_m,
            *(whole.joint_stiffness_nm_per_rad or ()),
            *(whole.joint_damping_nm_s_per_rad or ()),
        ]
        terms = ("tip", "rcm", "joint", "bias")
        return KernelTorqueLaw(kernel=hierarchical_impedance, arm=arm, terms=terms, gains=np.array(gains))


@compiled
def hierarchical_impedance(gains: Array, seen: Seen, memory: Array, out: Array) -> int:
    """Tau = J_T^T F_T + N_1 J_rcm^T F_rcm + N_2 tau_J + bias; rows tip, rcm, joint, bias (4, n) [N m].

        F_T   = K_X (p_d - p) + D_X (p_d' - p')
        F_rcm = -K_N e - D_N e'
        tau_J = K_N2 (q_ref - q) + D_N2 (q_ref' - q')
        N_i   = I - J_i^T (J_i M^-1 J_i^T)^-1 J_i M^-1,  J_1 = J_T,  J_2 = [J_T; J_rcm]

    N_i is the dynamically consistent null-space projector: its torque accelerates none of the rows of
    J_i. The bias compensates gravity, Coriolis and centrifugal torque of the nominal model.

    Source: gains from Table I of the VPRNN paper, which prints no torque law; the law is the hierarchical
    operational-space formulation that it cites (Khatib 1987; Sandoval et al. 2017; Su et al. 2019).
    """
    n, r = seen.q.size, seen.rows
    J, JMinv, L = scratch_matrix(3 + r, n), scratch_matrix(3 + r, n), scratch_matrix(n, n)
    L[:] = seen.M
    J[:3] = seen.Jv_WT
    for i in range(r):
        J[3 + i] = seen.J_rcm[i]
    JMinv[:] = J
    if not factor(L):
        return RANK_LOST
    back_substitute_rows(L, JMinv)
    force, rate = scratch(3), scratch(3)
    times(seen.Jv_WT, seen.v, rate)
    for i in range(3):
        force[i] = gains[i] * (seen.p_WTd[i] - seen.p_WT[i]) + gains[3 + i] * (seen.v_WTd[i] - rate[i])
    transposed_times(seen.Jv_WT, force, out[0])
    for i in range(r):
        e_dot = dot(seen.J_rcm[i], seen.v) - seen.rcm_velocity[i]
        force[i] = -gains[6] * seen.rcm_error[i] - gains[7] * e_dot
    transposed_times(J[3:], force[:r], out[1])
    for j in range(n):
        spring = gains[8 + j] * (seen.q_ref[j] - seen.q[j])
        out[2, j] = spring + gains[8 + n + j] * (seen.qdot_ref[j] - seen.v[j])
        out[3, j] = seen.bias[j]
    if not (project_torque(J[:3], JMinv[:3], out[1]) and project_torque(J, JMinv, out[2])):
        return RANK_LOST
    return GOES_ON


@compiled
def project_torque(J: Array, JMinv: Array, tau: Array) -> bool:
    """`tau` (n,) [N m] becomes (I - J^T (J M^-1 J^T)^-1 J M^-1) tau; False where J has lost rank.

    It is the part of `tau` that does not accelerate the rows of J.

    Args:
        J: Jacobian (m, n).
        JMinv: J M^-1 (m, n).
        tau: Joint torque (n,) [N m], changed in place.
    """
    m = J.shape[0]
    A, force = scratch_matrix(m, m), scratch(m)
    outer_product(JMinv, J, A)
    if not factor(A):
        return False
    times(JMinv, tau, force)
    back_substitute(A, force)
    for i in range(m):
        for j in range(tau.size):
            tau[j] -= J[i, j] * force[i]
    return True
