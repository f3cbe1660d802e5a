"""The constraint-consistent law and its rivals: their forms as written, each other, the plant's dynamics."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

import surgsim
from surgsim.contract.problems import torque_problem
from surgsim.control.manipulability import velocity_product_accelerations
from surgsim.control.torque_laws.constraint_consistent import TERMS, ConstraintConsistentConfig
from surgsim.control.torque_laws.null_space_basis import NullSpaceBasisConfig
from surgsim.control.torque_laws.projected_jacobian import ProjectedJacobianConfig
from surgsim.control.torque_laws.rcm_inverse_dynamics import RcmInverseDynamicsConfig
from surgsim.models.arm import ArmModel
from surgsim.models.build import build
from surgsim.models.config import RobotConfig, SceneConfig
from surgsim.scenario.load import load_scenario
from surgsim.simulate.setup import prepare

GAINS = {
    "rcm_stiffness_per_s2": 150.0,
    "rcm_damping_ratio": 0.8,
    "tip_stiffness_per_s2": 90.0,
    "tip_damping_ratio": 0.6,
    "joint_stiffness_per_s2": 30.0,
    "joint_damping_ratio": 1.2,
}
ROBOTS = ("test_arm_6", "lwr4plus", "panda", "test_arm_8")
FREE, CONSTRAINT = slice(0, 3), slice(3, 5)


@pytest.fixture(scope="module")
def arms():
    return {name: ArmModel(SceneConfig(robot=RobotConfig(name=name))) for name in ROBOTS}


@pytest.fixture(params=[(name, seed) for name in ROBOTS for seed in range(5)], ids=str)
def case(request, arms):
    """An arm, and a random state and command of it."""
    name, seed = request.param
    return arms[name], torque_problem(arms[name], seed)


def terms_of(config, arm, p):
    return config.build(arm).torque(p, None)[0]


def wanted(arm, p):
    """A, c, J, a, posture and h, in three-vectors: A and c have three rows of rank two, across the shaft."""
    z, C = p.kin.R_WT[:, 2], p.p_WC
    N, J, Jw = np.eye(3) - np.outer(z, z), p.kin.Jv_WT, p.kin.Jw_WT
    linear, angular = velocity_product_accelerations(p.kin, p.v)
    s, omega = z @ (p.kin.p_WT - C), Jw @ p.v
    arm_of_z = np.array([np.cross(column, z) for column in Jw.T]).T  # z' = arm_of_z q'
    A = N @ (J - s * arm_of_z)
    z_dot, z_ddot = arm_of_z @ p.v, np.cross(angular, z) + np.cross(omega, np.cross(omega, z))
    r_dot = J @ p.v - p.v_WC
    s_dot = z_dot @ (p.kin.p_WT - C) + z @ r_dot
    drift = N @ (linear - s * z_ddot - 2.0 * s_dot * z_dot)
    phi, phi_dot = N @ (p.kin.p_WT - C), A @ p.v - N @ p.v_WC
    rigid = {key: GAINS[f"{key}_stiffness_per_s2"] for key in ("rcm", "tip", "joint")}
    damped = {key: 2.0 * GAINS[f"{key}_damping_ratio"] * np.sqrt(k) for key, k in rigid.items()}
    c = N @ p.a_WC - drift - damped["rcm"] * phi_dot - rigid["rcm"] * phi
    a = p.command.a_WTd - linear + damped["tip"] * (p.command.v_WTd - J @ p.v)
    a = a + rigid["tip"] * (p.command.p_WTd - p.kin.p_WT)
    posture = rigid["joint"] * (p.q_ref - p.q) + damped["joint"] * (p.resolution.qdot - p.v)
    return A, c, J, a, posture, p.dyn.bias + arm.damping * p.v


def inverse(A):
    return np.linalg.pinv(A, rcond=1e-9)


def of_the_paper(arm, p):
    """tau_f and tau_c by P, M_c, Lambda, F and N_t as they are written, gravity in F and tau_0."""
    A, c, J, a, posture, h = wanted(arm, p)
    M, one = p.dyn.mass_matrix, np.eye(p.q.size)
    P = one - inverse(A) @ A
    M_c_inv = np.linalg.inv(P @ M + one - P)
    given = inverse(A) @ c
    Lambda = np.linalg.inv(J @ M_c_inv @ P @ J.T)
    F = Lambda @ (a + J @ M_c_inv @ (P @ h - given))
    N_t = one - J.T @ Lambda @ J @ M_c_inv @ P
    tau_f = P @ (J.T @ F + N_t @ (M @ posture + h))
    qddot = M_c_inv @ (P @ (tau_f - h) + given)
    return tau_f, (one - P) @ (M @ qddot + h)


def close(found, expected, relative):
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=relative * np.abs(expected).max())


def test_it_is_the_law_as_it_is_written_with_pseudo_inverses(case):
    arm, p = case
    terms = terms_of(ConstraintConsistentConfig(**GAINS), arm, p)
    tau_f, tau_c = of_the_paper(arm, p)
    close(terms[FREE].sum(axis=0), tau_f, 1e-9)
    close(terms[CONSTRAINT].sum(axis=0), tau_c, 1e-9)
    assert min(np.abs(tau_f).max(), np.abs(tau_c).max()) > 1e-2


def test_the_constraint_torque_is_a_force_on_the_constraint_alone(case):
    """tau_c = A^T Lambda_c (c + A M^-1 (h - tau_f)), by SVD; and A tau_f = 0."""
    arm, p = case
    A, c, _, _, _, h = wanted(arm, p)
    U, sizes, rows = np.linalg.svd(A)
    A, c = np.diag(sizes[:2]) @ rows[:2], U[:, :2].T @ c
    M_inv = np.linalg.inv(p.dyn.mass_matrix)
    terms = terms_of(ConstraintConsistentConfig(**GAINS), arm, p)
    tau_f = terms[FREE].sum(axis=0)
    force = np.linalg.solve(A @ M_inv @ A.T, c + A @ M_inv @ (h - tau_f))
    close(terms[CONSTRAINT].sum(axis=0), A.T @ force, 1e-9)
    for term in terms[FREE]:
        assert np.abs(A @ term).max() < 1e-10 * max(1.0, np.abs(term).max())


def test_with_a_virtual_rcm_it_is_the_strict_hierarchy(case):
    """rcm_inverse_dynamics without what it adds: observer and prediction. No limit is near."""
    arm, p = case
    strict = RcmInverseDynamicsConfig(**GAINS, observer_gain=0.0, most_delay_ticks=0)
    expected = terms_of(strict, arm, p)
    assert not expected[-1].any()
    total = terms_of(ConstraintConsistentConfig(**GAINS), arm, p).sum(axis=0)
    close(total, expected.sum(axis=0), 1e-12)
    dynamic = terms_of(ProjectedJacobianConfig(**GAINS, inverse="dynamic"), arm, p).sum(axis=0)
    close(dynamic, total, 1e-11)


def test_the_projected_jacobian_is_what_dense_projectors_make_of_it(case):
    arm, p = case
    A, c, J, a, posture, h = wanted(arm, p)
    M, one = p.dyn.mass_matrix, np.eye(p.q.size)
    M_inv = np.linalg.inv(M)
    shaft = A.T @ inverse(A @ M_inv @ A.T) @ c
    both = np.vstack([J, A])
    tip = (one - inverse(A) @ A) @ J.T @ np.linalg.solve(J @ M_inv @ J.T, a - J @ M_inv @ shaft)
    joint = (one - inverse(both) @ both) @ M @ posture
    terms = terms_of(ProjectedJacobianConfig(**GAINS), arm, p)
    for found, expected in zip(terms, (shaft, tip, joint, h), strict=True):
        close(found, expected, 1e-9)
    moved = A @ M_inv @ (terms.sum(axis=0) - h)
    assert np.abs(moved - c).max() > 1e-3  # the tip's force does move the RCM


def test_the_basis_of_the_null_space_is_one_by_svd(case):
    arm, p = case
    A, c, J, a, posture, h = wanted(arm, p)
    Z = np.linalg.svd(A)[2][2:].T
    given, JZ = inverse(A) @ c, J @ Z
    rate = inverse(JZ) @ (a - J @ given) + (np.eye(Z.shape[1]) - inverse(JZ) @ JZ) @ Z.T @ posture
    terms = terms_of(NullSpaceBasisConfig(**GAINS), arm, p)
    close(terms[0], p.dyn.mass_matrix @ (given + Z @ rate), 1e-9)
    close(terms[1], h, 1e-12)


@pytest.mark.parametrize(
    "config", [ConstraintConsistentConfig, NullSpaceBasisConfig], ids=lambda c: c.__name__
)
@pytest.mark.parametrize("seed", range(3))
def test_the_plant_accelerates_as_the_constraint_asks(arms, config, seed):
    """A q'' = c and J q'' = a with q'' of MuJoCo's forward dynamics under the law's torque."""
    arm, scene = arms["panda"], build(SceneConfig(robot=RobotConfig(name="panda"), theatre=False))
    p, data = torque_problem(arm, seed), mujoco.MjData(scene.model)
    data.qpos[scene.qpos_ids], data.qvel[scene.dof_ids] = p.q, p.v
    data.qfrc_applied[scene.dof_ids] = terms_of(config(**GAINS), arm, p).sum(axis=0)
    mujoco.mj_forward(scene.model, data)
    A, c, J, a, _, _ = wanted(arm, p)
    qddot = data.qacc[scene.dof_ids]
    assert np.abs(A @ qddot - c).max() < 1e-8
    assert np.abs(J @ qddot - a).max() < 1e-8
    assert np.abs(c).max() > 0.1


@pytest.mark.parametrize("law", ["constraint_consistent", "null_space_basis", "projected_jacobian"])
def test_without_a_trocar_it_is_a_law_of_the_tip(arms, law):
    configs = {
        "constraint_consistent": ConstraintConsistentConfig(**GAINS),
        "null_space_basis": NullSpaceBasisConfig(**GAINS),
        "projected_jacobian": ProjectedJacobianConfig(**GAINS),
    }
    p = torque_problem(arms["lwr4plus"], 3, trocar=False)
    torque = terms_of(configs[law], arms["lwr4plus"], p).sum(axis=0)
    h = p.dyn.bias + arms["lwr4plus"].damping * p.v
    linear, _ = velocity_product_accelerations(p.kin, p.v)
    a = p.command.a_WTd - linear + 90.0 * (p.command.p_WTd - p.kin.p_WT)
    a = a + 2.0 * 0.6 * np.sqrt(90.0) * (p.command.v_WTd - p.kin.Jv_WT @ p.v)
    found = p.kin.Jv_WT @ np.linalg.solve(p.dyn.mass_matrix, torque - h)
    if law != "projected_jacobian":  # whose posture's torque is projected plainly
        np.testing.assert_allclose(found, a, atol=1e-9 * np.abs(a).max())
    assert np.isfinite(torque).all()


@pytest.mark.parametrize("seed", range(3))
def test_cut_at_the_limits_it_loses_the_rcm_where_the_hierarchy_gives_way_in_order(arms, seed):
    arm, p = arms["lwr4plus"], torque_problem(arms["lwr4plus"], seed)
    p = replace(p, command=replace(p.command, a_WTd=np.array([300.0, 200.0, -300.0])))
    A, c, _, _, _, h = wanted(arm, p)
    strict = RcmInverseDynamicsConfig(**GAINS, observer_gain=0.0, most_delay_ticks=0)
    missed = []
    for config in (ConstraintConsistentConfig(**GAINS), strict):
        torque = np.clip(terms_of(config, arm, p).sum(axis=0), -arm.limits.torque, arm.limits.torque)
        missed.append(np.linalg.norm(A @ np.linalg.solve(p.dyn.mass_matrix, torque - h) - c))
    assert missed[0] > 1.0
    assert missed[1] < 1e-3


def test_shares_scale_their_terms_alone(arms):
    p = torque_problem(arms["panda"], 1)
    whole = terms_of(ConstraintConsistentConfig(), arms["panda"], p)
    part = ConstraintConsistentConfig(constraint_share=0.25, constraint_bias_share=0.5)
    np.testing.assert_allclose(
        terms_of(part, arms["panda"], p), whole * np.array([[1], [1], [1], [0.25], [0.5]]), rtol=1e-14
    )


def test_a_rigid_port_without_play_carries_what_the_law_leaves_out(case):
    """M q'' + h = tau + A^T f, A q'' = c: the motion is that of a virtual RCM for every share."""
    arm, p = case
    A, c, _, _, _, h = wanted(arm, p)
    U, sizes, rows = np.linalg.svd(A)
    A, c, M, n = np.diag(sizes[:2]) @ rows[:2], U[:, :2].T @ c, p.dyn.mass_matrix, p.q.size
    system = np.block([[M, -A.T], [A, np.zeros((2, 2))]])
    solved, tau_c = {}, terms_of(ConstraintConsistentConfig(**GAINS), arm, p)[CONSTRAINT].sum(axis=0)
    for share in (0.0, 0.3, 1.0):
        config = ConstraintConsistentConfig(**GAINS, constraint_share=share, constraint_bias_share=share)
        torque = terms_of(config, arm, p).sum(axis=0)
        solved[share] = np.linalg.solve(system, np.concatenate([torque - h, c]))
        close(solved[share][:n], solved[0.0][:n], 1e-9)
        carried = A.T @ solved[share][n:]
        np.testing.assert_allclose(carried, (1.0 - share) * tau_c, atol=1e-9 * np.abs(tau_c).max())


def test_without_the_constraint_the_free_torque_moves_the_tip_the_wrong_way():
    """J M^-1 P J^T, what tau_f does to the tip of an arm that nothing holds, has a negative direction."""
    for name in ("rcm_spiral_lwr4plus", "rcm_spiral_panda"):
        setup = prepare(load_scenario(name))
        kin, M = (
            setup.arm.evaluate(setup.q_start, np.zeros(7))[0],
            setup.arm.dynamics(setup.q_start, np.zeros(7)),
        )
        z = kin.R_WT[:, 2]
        s = z @ (kin.p_WT - np.array(setup.scenario.trocar.position_m))
        turned = np.array([np.cross(column, z) for column in kin.Jw_WT.T]).T
        A = (np.eye(3) - np.outer(z, z)) @ (kin.Jv_WT - s * turned)
        P = np.eye(7) - inverse(A) @ A
        mobility = kin.Jv_WT @ np.linalg.inv(M.mass_matrix) @ P @ kin.Jv_WT.T
        assert np.linalg.eigvals(mobility).real.min() < -0.01


WALL = (
    "trocar.wall={lateral_stiffness_n_per_m: 1.0e+5, lateral_damping_n_s_per_m: 200.0, mass_kg: 0.5, "
    "contact_stiffness_n_per_m: 1.0e+6, contact_damping_n_s_per_m: 100.0, tear_force_n: 1000.0}"
)
SHORT = ("task.duration_s=0.8", "task.ramp_s=0.3", "task.hold_start_s=0.1", "task.hold_end_s=0.1")


def at_a_stand(share):
    """Run of a slow circle through a port on a stand that can carry the constraint's torque."""
    law = {"constraint_share": share, "tip_stiffness_per_s2": 25.0, "rcm_stiffness_per_s2": 50.0}
    changes = [f"controller.torque_law.{key}={value}" for key, value in law.items()]
    return surgsim.run(
        load_scenario(
            "circle_panda",
            controller="constraint_consistent",
            assignments=[*SHORT, "task.radius_m=0.001", "simulation.timestep_s=0.00025", WALL, *changes],
        )
    )


def test_at_a_real_port_the_share_decides_who_carries_the_constraint():
    """Where it is no strict hierarchy: with share 0 the port's force is what the law leaves out."""
    virtual, left_out = at_a_stand(1.0), at_a_stand(0.0)
    assert virtual.metrics["trocar_force_max_n"] < 1.1  # the seal's friction
    assert left_out.metrics["trocar_force_max_n"] > 3.0
    assert np.abs(virtual.trace.block("tau_constraint_")[:-1]).max() > 1e-3
    assert not left_out.trace.block("tau_constraint_")[:-1].any()
    terms = sum(left_out.trace.block(f"tau_{term}_") for term in TERMS)
    assert terms[:-1] == pytest.approx(left_out.trace.block("tau")[:-1], abs=1e-9)
