"""QP resolver: its program, its optimality, what gives way and what never does."""

import json
from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.optimize import lsq_linear
from usual_arm import usual_arm

from surgsim.control.failure import ControlFailure
from surgsim.control.planes import PlaneConfig
from surgsim.control.qp import SHIPPED
from surgsim.control.resolvers.qp import QpConfig
from surgsim.control.resolvers.vprnn import VprnnConfig
from surgsim.errors import Outcome
from surgsim.runs.folder import run_to_folder
from surgsim.simulate.loop import simulate

LATE = 10.0  # nothing is left of the VPRNN's error
seeds = pytest.mark.parametrize("seed", range(5))
trocar_or_none = pytest.mark.parametrize("trocar", [True, False])


def _step(config, p):
    resolver = config.build(usual_arm())
    return resolver.step(p, resolver.start(p))[0]


def _wanted(p, k=5.0):
    tip = p.command.v_WTd - k * (p.kin.p_WT - p.command.p_WTd)
    return tip, None if p.rcm is None else p.rcm.trocar_velocity - k * p.rcm.error


def _log_mu_gradient(arm, q, h=1e-6):
    def log_mu(x):
        return np.log(np.linalg.svd(arm.kinematics(x).Jv_WT, compute_uv=False)).sum()

    return np.array([(log_mu(q + h * e) - log_mu(q - h * e)) / (2 * h) for e in np.eye(7)])


@seeds
@trocar_or_none
def test_qp_and_vprnn_agree_where_no_bound_is_active(velocity_problem, seed, trocar):
    p = velocity_problem(seed, trocar=trocar, speed=0.005, t_s=LATE)
    vprnn = VprnnConfig()
    qp = QpConfig(
        tip="hard",
        manipulability_weight=vprnn.h0,
        velocity_weight=vprnn.h1,
        acceleration_limit=False,
        k_tip=vprnn.k1,
        k_rcm=vprnn.k2,
    )
    network = vprnn.build(usual_arm())
    expected = network.step(p, network.start(p))[0].qdot
    assert (expected > p.lower).all()
    assert (expected < p.upper).all()
    np.testing.assert_allclose(_step(qp, p).qdot, expected, atol=1e-8)


@seeds
@trocar_or_none
def test_the_slack_costs_lambda_w_s_lambda_without_a_half(arm, velocity_problem, seed, trocar):
    """From the stationarity of the objective as printed: (W + 2 W_s J^T J) q' + J_rcm^T y = ..."""
    W, W_s, w = 2.0, 7.0, 0.01
    p = velocity_problem(seed, trocar=trocar, speed=0.02, rcm_error_m=0.001)
    config = QpConfig(velocity_weight=W, slack_weight=W_s, manipulability_weight=w, acceleration_limit=False)
    tip, shaft = _wanted(p)
    J, J_r = p.kin.Jv_WT, p.rcm.jacobian if trocar else np.zeros((0, 7))
    shaft = shaft if trocar else np.zeros(0)

    def optimum(factor):
        r = len(J_r)
        K = np.block([[W * np.eye(7) + factor * W_s * J.T @ J, J_r.T], [J_r, np.zeros((r, r))]])
        right = factor * W_s * J.T @ tip + w * _log_mu_gradient(arm, p.q)
        return np.linalg.solve(K, np.concatenate([right, shaft]))[:7]

    answer = _step(config, p).qdot
    np.testing.assert_allclose(answer, optimum(2.0), atol=1e-7)
    assert np.abs(optimum(2.0) - optimum(1.0)).max() > 1e-4


def _assert_kkt(config, p, qdot, lower, upper, gradient):
    """Optimality over q' alone, with the slack eliminated: s = J q' - v."""
    tip, shaft = _wanted(p)
    slope = config.velocity_weight * qdot - config.manipulability_weight * gradient
    slope = slope + 2.0 * config.slack_weight * p.kin.Jv_WT.T @ (p.kin.Jv_WT @ qdot - tip)
    np.testing.assert_allclose(p.rcm.jacobian @ qdot, shaft, atol=1e-9)
    at_low, at_high = qdot < lower + 1e-10, qdot > upper - 1e-10
    rows = np.vstack([np.eye(7)[at_low], -np.eye(7)[at_high], p.rcm.jacobian])
    signs = np.r_[np.zeros(at_low.sum() + at_high.sum()), np.full(2, -np.inf)]
    y = lsq_linear(rows.T, slope, (signs, np.inf), tol=1e-14).x
    np.testing.assert_allclose(rows.T @ y, slope, atol=1e-6 * np.abs(slope).max())
    return at_low.sum() + at_high.sum()


@pytest.mark.parametrize("slack_weight", [1e2, 1e4, 1e6])
def test_answers_at_the_bounds_satisfy_kkt_with_the_rcm_exact(arm, velocity_problem, slack_weight):
    config = QpConfig(slack_weight=slack_weight, manipulability_weight=0.1, acceleration_limit=False)
    solved = active = 0
    for seed in range(20):
        p = velocity_problem(seed, speed=3.0, rcm_error_m=0.002)
        try:
            answer = _step(config, p)
        except ControlFailure:
            continue
        gradient = _log_mu_gradient(arm, p.q)
        active += bool(_assert_kkt(config, p, answer.qdot, p.lower, p.upper, gradient))
        solved += 1
    assert solved >= 18
    assert active >= 5


@seeds
def test_the_tip_gives_way_at_a_velocity_bound_and_the_rcm_does_not(velocity_problem, seed):
    p = velocity_problem(seed, speed=20.0, rcm_error_m=0.002)
    answer = _step(QpConfig(acceleration_limit=False), p)
    tip, shaft = _wanted(p)
    assert np.linalg.norm(p.kin.Jv_WT @ answer.qdot - tip) > 0.1
    np.testing.assert_allclose(p.rcm.jacobian @ answer.qdot, shaft, atol=1e-9)
    assert (np.isclose(answer.qdot, p.lower) | np.isclose(answer.qdot, p.upper)).any()
    assert answer.residual == pytest.approx(np.linalg.norm(p.kin.Jv_WT @ answer.qdot - tip))


@seeds
def test_a_workspace_plane_bounds_the_speed_towards_it_and_leaves_the_rcm_alone(velocity_problem, seed):
    p = velocity_problem(seed, speed=0.0, rcm_error_m=0.001)
    normal = np.random.default_rng(seed).standard_normal(3)
    n = normal / np.linalg.norm(normal)
    p = replace(p, command=replace(p.command, p_WTd=p.kin.p_WT, v_WTd=0.05 * n))
    room = 0.001
    plane = PlaneConfig(normal=tuple(normal), offset_m=float(n @ p.kin.p_WT) + room)
    for planes, speed in (((plane,), 20.0 * room), ((), 0.05)):
        answer = _step(QpConfig(planes=planes, acceleration_limit=False), p)
        v = p.kin.Jv_WT @ answer.qdot
        assert n @ v == pytest.approx(speed, abs=3e-5)
        np.testing.assert_allclose(v - n * (n @ v), 0.0, atol=3e-5)  # along the wall it is free
        np.testing.assert_allclose(p.rcm.jacobian @ answer.qdot, _wanted(p)[1], atol=1e-9)


def test_a_tip_beyond_a_plane_is_driven_back(velocity_problem):
    p = velocity_problem(0, speed=0.0)
    plane = PlaneConfig(normal=(0.0, 0.0, 2.0), offset_m=float(p.kin.p_WT[2]) - 0.001)
    answer = _step(QpConfig(planes=(plane,), acceleration_limit=False), p)
    assert (p.kin.Jv_WT @ answer.qdot)[2] == pytest.approx(-0.02, abs=1e-9)


KINEMATIC = ("plant={type: kinematic}",)


def test_a_run_stops_at_a_wall_with_the_shaft_in_the_trocar(scenario):
    wall = "controller.resolver={type: qp, planes: [{normal: [0, 1, 0], offset_m: 0.551}]}"
    trace = simulate(scenario(*KINEMATIC, wall))
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    assert trace["tip_ref_y_m"].max() > 0.5515
    assert 0.5507 < trace["tip_y_m"].max() < 0.551
    assert trace["rcm_error_m"].max() < 2e-5
    assert trace["tip_error_m"].max() > 5e-4


@pytest.mark.parametrize("limit", [True, False])
def test_joint_accelerations_are_limited_when_asked_to(scenario, limit):
    fast = ("task.radius_m=0.02", "task.duration_s=0.4", "task.ramp_s=0.05")
    resolver = f"controller.resolver={{type: qp, acceleration_limit: {str(limit).lower()}}}"
    trace = simulate(scenario(*KINEMATIC, *fast, resolver))
    qdot = trace.block("qdot_ref")
    qdot = np.vstack([np.zeros(7), qdot[np.isfinite(qdot).all(axis=1)]])
    ratio = np.abs(np.diff(qdot, axis=0)) / 0.001 / np.array(trace.meta.limits["acceleration"])
    assert (ratio.max() <= 1.0 + 1e-9) == limit


def test_the_memory_is_the_last_velocity_and_starts_at_the_measured_one(velocity_problem):
    p = velocity_problem(0, rcm_error_m=0.0, trocar_speed=0.0)
    p = replace(p, v=p.v - np.linalg.pinv(p.rcm.jacobian) @ p.rcm.jacobian @ p.v)
    resolver = QpConfig().build(usual_arm())
    answer, memory = resolver.step(p, resolver.start(p))
    np.testing.assert_array_equal(memory[:7], answer.qdot)
    assert (np.abs(answer.qdot - p.v) <= p.limits.acceleration * p.dt_s * (1 + 1e-9)).all()


@seeds
@pytest.mark.parametrize("speed", [0.05, 0.5])
def test_every_shipped_solver_gives_the_same_velocities(velocity_problem, seed, speed):
    p = velocity_problem(seed, speed=speed, rcm_error_m=0.001)
    ours, *others = (_step(QpConfig(solver=s, acceleration_limit=False), p).qdot for s in SHIPPED)
    for other in others:
        np.testing.assert_allclose(other, ours, atol=1e-7)


def test_an_unknown_solver_is_refused_with_the_nearest_match():
    with pytest.raises(ValidationError, match=r"'daqpp' is not a QP solver.*Did you mean 'daqp'\?"):
        QpConfig(solver="daqpp")


def test_the_kernel_is_the_same_without_its_decorator(velocity_problem):
    """Compiled code inside, the law itself as Python."""
    p = velocity_problem(0, speed=0.5, rcm_error_m=0.001)
    resolver = QpConfig(acceleration_limit=False).build(usual_arm())
    answer, memory = resolver.step(p, None)
    plain, remembered = replace(resolver, kernel=resolver.kernel.py_func).step(p, None)
    np.testing.assert_array_equal(plain.qdot, answer.qdot)
    np.testing.assert_array_equal(remembered, memory)


@pytest.mark.parametrize("solver", SHIPPED)
def test_an_infeasible_program_is_an_outcome_with_its_matrices(velocity_problem, solver):
    p = velocity_problem(0, speed=50.0)
    text = "^QP: no joint velocity meets 5 task rows, 0 planes and the bounds$"
    with pytest.raises(ControlFailure, match=text) as failure:
        _step(QpConfig(tip="hard", acceleration_limit=False, solver=solver), p)
    assert failure.value.outcome is Outcome.INFEASIBLE
    data = failure.value.data
    np.testing.assert_array_equal(data["G"], np.vstack([p.kin.Jv_WT, p.rcm.jacobian]))
    np.testing.assert_array_equal(data["G_lower"], data["G_upper"])
    np.testing.assert_array_equal(data["lower"], p.lower)
    np.testing.assert_array_equal(data["upper"], p.upper)
    assert data["H"].shape == (7, 7)
    reach = np.abs(data["G"]) @ np.maximum(np.abs(data["lower"]), data["upper"])
    assert (np.abs(data["G_lower"]) > reach).any()  # a row that no velocity inside the bounds can meet


def _strict(text):
    def refuse(name):
        raise AssertionError(f"{name} is not JSON")

    return json.loads(text, parse_constant=refuse)


@pytest.mark.parametrize("tip", ["hard", "soft"])
def test_a_run_ends_as_infeasible_with_the_program_in_its_metrics(scenario, tmp_path, tip):
    """A hard tip that is asked for too much; or with a soft one, an RCM that the bounds put out of reach."""
    if tip == "hard":
        changes = ("task.radius_m=0.02", "task.duration_s=0.04", "task.ramp_s=0.02")
    else:
        q = [1.5708, -0.5236, 0.0, 1.5708, 0.0, -1.0472, 0.0]
        changes = (f"start={{posture_rad: {q}}}", "controller.resolver.k_rcm=1e9")
    resolver = f"controller.resolver={{type: qp, tip: {tip}, acceleration_limit: false}}"
    result = run_to_folder(scenario(*KINEMATIC, resolver, *changes), tmp_path / "run", record=False)
    assert result.trace.meta.ending.outcome is Outcome.INFEASIBLE
    outcome = _strict((tmp_path / "run" / "metrics.json").read_text())["outcome"]
    assert outcome["name"] == "infeasible"
    assert outcome["detail"].startswith("QP: no joint velocity meets")
    data = {name: np.array(values, dtype=float) for name, values in outcome["data"].items()}
    assert sorted(data) == ["G", "G_lower", "G_upper", "H", "f", "lower", "upper"]
    assert data["G"].shape == (5, 7 if tip == "hard" else 10)
