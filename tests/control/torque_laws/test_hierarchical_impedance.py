"""The hierarchical impedance law against the formula written with dense projectors."""

from dataclasses import replace

import numpy as np
import pytest
from usual_arm import usual_arm

from surgsim.control.rcm import rcm_kinematics
from surgsim.control.torque_laws.base import for_joints
from surgsim.control.torque_laws.hierarchical_impedance import HierarchicalImpedanceConfig
from surgsim.errors import SurgsimError

TIP, RCM, JOINT, BIAS = range(4)
UNEQUAL = HierarchicalImpedanceConfig(
    tip_stiffness_n_per_m=(1000.0, 2000.0, 3000.0), tip_damping_n_s_per_m=(10.0, 20.0, 30.0)
)
STIFFNESS = (80.0, 120.0, 60.0, 30.0, 20.0, 10.0, 10.0)
DAMPING = (6.0, 10.0, 5.0, 3.0, 2.0, 1.0, 1.0)
cases = pytest.mark.parametrize(("seed", "trocar"), [(0, True), (1, True), (2, False)])


@pytest.fixture
def problem(torque_problem, seed, trocar):
    return torque_problem(seed, trocar=trocar)


def _torque(problem, config=UNEQUAL):
    law = config.build(usual_arm())
    return law.torque(problem, law.start(problem))[0]


def _projector(J, M):
    """I - J^T Lambda J M^-1, Lambda = (J M^-1 J^T)^-1."""
    M_inv = np.linalg.inv(M)
    return np.eye(7) - J.T @ np.linalg.inv(J @ M_inv @ J.T) @ J @ M_inv


def _literal(p, c):
    J_T, M = p.kin.Jv_WT, p.dyn.mass_matrix
    p_dot = J_T @ p.v
    F = np.diag(c.tip_stiffness_n_per_m) @ (p.command.p_WTd - p.kin.p_WT)
    F = F + np.diag(c.tip_damping_n_s_per_m) @ (p.command.v_WTd - p_dot)
    joint = np.diag(STIFFNESS) @ (p.q_ref - p.q)
    joint = joint + np.diag(DAMPING) @ (p.resolution.qdot - p.v)
    if p.rcm is None:
        return np.array([J_T.T @ F, np.zeros(7), _projector(J_T, M) @ joint, p.dyn.bias])
    J_r = p.rcm.jacobian
    pull = -c.rcm_stiffness_n_per_m * p.rcm.error
    pull = pull - c.rcm_damping_n_s_per_m * (J_r @ p.v - p.rcm.trocar_velocity)
    below = _projector(np.vstack([J_T, J_r]), M)
    return np.array([J_T.T @ F, _projector(J_T, M) @ J_r.T @ pull, below @ joint, p.dyn.bias])


def test_default_gains_are_those_of_table_1():
    c = HierarchicalImpedanceConfig()
    assert c.tip_stiffness_n_per_m == (3000.0,) * 3
    assert c.tip_damping_n_s_per_m == (30.0,) * 3
    assert (c.rcm_stiffness_n_per_m, c.rcm_damping_n_s_per_m) == (800.0, 10.0)
    gains = c.build(usual_arm()).gains
    np.testing.assert_array_equal(gains[8:15], STIFFNESS)
    np.testing.assert_array_equal(gains[15:], DAMPING)


def test_on_other_arms_they_are_read_off_between_base_and_flange():
    """Six joints are 6/5 places of the table apart, eight joints 6/7."""
    six = [80.0, 108.0, 48.0, 24.0, 12.0, 10.0]
    np.testing.assert_allclose(for_joints("k", None, STIFFNESS, 6), six, rtol=1e-12)
    eight = for_joints("k", None, STIFFNESS, 8)
    assert (eight[0], eight[-1], eight.size) == (80.0, 10.0, 8)
    assert eight[1] == pytest.approx(80.0 + 40.0 * 6 / 7)
    assert eight[4] == pytest.approx(30.0 - 10.0 * 3 / 7)


def test_a_list_of_another_length_is_refused():
    config = HierarchicalImpedanceConfig(joint_damping_nm_s_per_rad=(1.0,) * 6)
    reason = r"^joint_damping_nm_s_per_rad has 6 items for an arm of 7 joints: give 7, or null$"
    with pytest.raises(SurgsimError, match=reason):
        config.build(usual_arm())


@cases
def test_terms_are_those_of_the_formula(problem):
    np.testing.assert_allclose(_torque(problem), _literal(problem, UNEQUAL), atol=1e-9)
    assert UNEQUAL.build(usual_arm()).terms == ("tip", "rcm", "joint", "bias")


@cases
def test_lower_terms_do_not_accelerate_what_is_above_them(problem):
    terms, J_T = _torque(problem), problem.kin.Jv_WT
    acceleration = np.linalg.solve(problem.dyn.mass_matrix, terms.T).T
    np.testing.assert_allclose(J_T @ acceleration[RCM], 0.0, atol=1e-10)
    np.testing.assert_allclose(J_T @ acceleration[JOINT], 0.0, atol=1e-10)
    assert np.linalg.norm(acceleration[JOINT]) > 0.1
    assert np.linalg.norm(J_T @ acceleration[TIP]) > 0.1
    if problem.rcm is not None:
        np.testing.assert_allclose(problem.rcm.jacobian @ acceleration[JOINT], 0.0, atol=1e-10)
        assert np.linalg.norm(problem.rcm.jacobian @ acceleration[RCM]) > 1e-3


@cases
def test_at_rest_at_the_reference_only_the_bias_is_left(arm, problem):
    p, still = problem, np.zeros(7)
    rcm, p_WC = None, p.p_WC
    if p.rcm is not None:
        p_WC = p.kin.p_WT - 0.2 * p.kin.R_WT[:, 2]
        rcm = rcm_kinematics(p.kin, p_WC, np.zeros(3))
    p = replace(
        p,
        v=still,
        dyn=arm.dynamics(p.q, still),
        rcm=rcm,
        p_WC=p_WC,
        v_WC=np.zeros(3),
        command=replace(p.command, p_WTd=p.kin.p_WT, v_WTd=np.zeros(3)),
        resolution=replace(p.resolution, qdot=still),
        q_ref=p.q,
    )
    terms = _torque(p)
    np.testing.assert_allclose(terms.sum(axis=0), arm.dynamics(p.q, still).bias, atol=1e-10)
    np.testing.assert_allclose(terms[:BIAS], 0.0, atol=1e-10)


@pytest.mark.parametrize(("seed", "trocar"), [(3, True)])
def test_a_trocar_that_moves_with_the_shaft_is_not_damped(problem):
    p = problem
    rcm = replace(p.rcm, error=np.zeros(2), trocar_velocity=p.rcm.jacobian @ p.v)
    np.testing.assert_allclose(_torque(replace(p, rcm=rcm))[RCM], 0.0, atol=1e-12)
