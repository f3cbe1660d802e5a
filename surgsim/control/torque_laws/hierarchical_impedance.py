"""Hierarchical impedance: tip, then RCM, then joint compliance, each in the null space of those above."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import NonNegativeFloat

from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.control.torque_laws.base import TorqueProblem
from surgsim.models.arm import ArmModel
from surgsim.models.config import Vec3, Vec7

Array = NDArray[np.float64]


class HierarchicalImpedanceConfig(PartConfig):
    """Cartesian compliance of the tip, RCM compliance in its null space, joint compliance below both.

    Attributes:
        tip_stiffness_n_per_m: K_X, diagonal.
        tip_damping_n_s_per_m: D_X, diagonal.
        rcm_stiffness_n_per_m: K_N.
        rcm_damping_n_s_per_m: D_N.
        joint_stiffness_nm_per_rad: K_N2, diagonal.
        joint_damping_nm_s_per_rad: D_N2 (K_D2 in Table I), diagonal.
    """

    type: Literal["hierarchical_impedance"] = "hierarchical_impedance"
    tip_stiffness_n_per_m: Vec3 = (3000.0, 3000.0, 3000.0)
    tip_damping_n_s_per_m: Vec3 = (30.0, 30.0, 30.0)
    rcm_stiffness_n_per_m: NonNegativeFloat = 800.0
    rcm_damping_n_s_per_m: NonNegativeFloat = 10.0
    joint_stiffness_nm_per_rad: Vec7 = (80.0, 120.0, 60.0, 30.0, 20.0, 10.0, 10.0)
    joint_damping_nm_s_per_rad: Vec7 = (6.0, 10.0, 5.0, 3.0, 2.0, 1.0, 1.0)

    def build(self, arm: ArmModel) -> "HierarchicalImpedance":
        """The law."""
        return HierarchicalImpedance(self)


class HierarchicalImpedance:
    """tau = J_T^T F_T + N_1 J_rcm^T F_rcm + N_2 tau_J + bias.

        F_T   = K_X (p_d - p) + D_X (p_d' - p')
        F_rcm = -K_N e - D_N e'
        tau_J = K_N2 (q_ref - q) + D_N2 (q_ref' - q')
        N_i   = I - J_i^T (J_i M^-1 J_i^T)^-1 J_i M^-1,  J_1 = J_T,  J_2 = [J_T; J_rcm]

    N_i is the dynamically consistent null-space projector: its torque accelerates none of the rows of
    J_i. The bias compensates gravity, Coriolis and centrifugal torque of the nominal model.

    Source: gains from Table I of the VPRNN paper, which prints no torque law; the law is the hierarchical
    operational-space formulation that it cites (Khatib 1987; Sandoval et al. 2017; Su et al. 2019).
    """

    terms = ("tip", "rcm", "joint", "bias")

    def __init__(self, config: HierarchicalImpedanceConfig) -> None:
        self._K_X = np.array(config.tip_stiffness_n_per_m)
        self._D_X = np.array(config.tip_damping_n_s_per_m)
        self._K_N = config.rcm_stiffness_n_per_m
        self._D_N = config.rcm_damping_n_s_per_m
        self._K_N2 = np.array(config.joint_stiffness_nm_per_rad)
        self._D_N2 = np.array(config.joint_damping_nm_s_per_rad)

    def start(self, problem: TorqueProblem) -> None:
        """The law has no state."""

    def torque(self, problem: TorqueProblem, memory: None) -> tuple[Array, None]:
        """Rows tip, rcm, joint, bias (4, 7) [N m]."""
        p, kin, command, rcm = problem, problem.kin, problem.command, problem.rcm
        return _hierarchy(
            p.dyn.mass_matrix,
            p.dyn.bias,
            kin.Jv_WT,
            command.p_WTd - kin.p_WT,
            command.v_WTd,
            _NO_ROWS if rcm is None else rcm.jacobian,
            _NO_ROWS[:, 0] if rcm is None else rcm.error,
            _NO_ROWS[:, 0] if rcm is None else rcm.trocar_velocity,
            p.q_ref - p.q,
            p.resolution.qdot,
            p.v,
            self._K_X,
            self._D_X,
            self._K_N,
            self._D_N,
            self._K_N2,
            self._D_N2,
        ), None


_NO_ROWS = np.zeros((0, 7))


@compiled
def _hierarchy(
    M: Array,
    bias: Array,
    J_T: Array,
    tip_gap: Array,
    v_d: Array,
    J_r: Array,
    error: Array,
    trocar_velocity: Array,
    joint_gap: Array,
    qdot_ref: Array,
    v: Array,
    K_X: Array,
    D_X: Array,
    K_N: float,
    D_N: float,
    K_N2: Array,
    D_N2: Array,
) -> Array:
    """Rows tip, rcm, joint, bias of the torque (4, 7) [N m]."""
    F_T = K_X * tip_gap + D_X * (v_d - J_T @ v)
    F_r = -K_N * error - D_N * (J_r @ v - trocar_velocity)
    J = np.concatenate((J_T, J_r))
    JMinv = np.ascontiguousarray(np.linalg.solve(M, J.T).T)
    out = np.empty((4, 7))
    out[0] = F_T @ J_T
    out[1] = null_space_torque(J_T, JMinv[:3], F_r @ J_r)
    out[2] = null_space_torque(J, JMinv, K_N2 * joint_gap + D_N2 * (qdot_ref - v))
    out[3] = bias
    return out


@compiled
def null_space_torque(J: Array, JMinv: Array, tau: Array) -> Array:
    """(I - J^T (J M^-1 J^T)^-1 J M^-1) tau: the part of `tau` (7,) that does not accelerate the rows of J.

    Args:
        J: Jacobian (m, 7).
        JMinv: J M^-1 (m, 7).
        tau: Joint torque (7,) [N m].
    """
    return tau - np.linalg.solve(JMinv @ J.T, JMinv @ tau) @ J
