"""RCM inverse dynamics: its terms by an independent formula, its prediction, whole disturbed runs."""

from dataclasses import replace

import numpy as np
import pytest

from surgsim.control.observer import delay_size, observer_size
from surgsim.control.rcm import rcm_kinematics
from surgsim.control.torque_laws.rcm_inverse_dynamics import (
    RcmInverseDynamicsConfig,
)
from surgsim.control.torque_laws.rcm_inverse_dynamics import (
    predict as predict_in_place,
)
from surgsim.errors import Outcome
from surgsim.models.build import build
from surgsim.models.config import RobotConfig, SceneConfig
from surgsim.plant.dynamic import DynamicPlantConfig
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import simulate

TERMS = ("tip", "rcm", "joint", "bias", "observer", "limits")
SOFT = RcmInverseDynamicsConfig(
    rcm_stiffness_per_s2=150.0,
    rcm_damping_ratio=0.8,
    tip_stiffness_per_s2=90.0,
    tip_damping_ratio=0.6,
    joint_stiffness_per_s2=30.0,
    joint_damping_ratio=1.2,
)
cases = pytest.mark.parametrize(("seed", "trocar"), [(0, True), (1, True), (2, True), (3, False)])


@pytest.fixture
def problem(torque_problem, seed, trocar):
    return torque_problem(seed, trocar=trocar)


KNOWN = SOFT.model_copy(update={"observer_gain": 0.0})  # what the observer knows stays as it is
MOST = 20


def _memory(d=None, commands=None):
    """What the law remembers: a disturbance (7,), and torques commanded, newest first (n, 7)."""
    memory = np.zeros(observer_size(7) + delay_size(7, MOST))
    memory[:7] = 0.0 if d is None else d
    sent = memory[observer_size(7) :][: 7 * (MOST + 1)].reshape(MOST + 1, 7)
    sent[:] = np.nan
    if commands is not None:
        sent[:] = commands[: MOST + 1]
    return memory


def _commands(memory):
    """The torques that a memory holds, newest first (n, 7)."""
    return memory[observer_size(7) :][: 7 * (MOST + 1)].reshape(MOST + 1, 7)


def predict(p, in_flight, d, damping):
    """State after the torques `in_flight` (n, 7), oldest first."""
    q, v, newest_first = p.q.copy(), p.v.copy(), np.ascontiguousarray(in_flight[::-1]).ravel()
    M, bias, ticks = p.dyn.mass_matrix, p.dyn.bias, len(in_flight)
    assert predict_in_place(q, v, M, bias, d, damping, newest_first, ticks, p.dt_s)
    return q, v


def _second_derivatives(arm, p, h=1e-4):
    """Tip and shaft accelerations at zero joint acceleration, by differences along q + v t."""

    def tip(t):
        return arm.kinematics(p.q + p.v * t).p_WT

    def error(t):
        kin = arm.kinematics(p.q + p.v * t)
        r, d = kin.p_WT - p.p_WC - p.v_WC * t, kin.R_WT[:, 2]
        return r - d * (d @ r)

    second = [(f(h) - 2.0 * f(0.0) + f(-h)) / h**2 for f in (tip, error)]
    return second[0], p.kin.R_WT[:, :2].T @ second[1]


def _wanted(arm, p, c):
    """Rows, their accelerations, and the posture's."""
    tip_bias, rcm_bias = _second_derivatives(arm, p)
    J = p.kin.Jv_WT
    a = p.command.a_WTd - tip_bias + c.tip_stiffness_per_s2 * (p.command.p_WTd - p.kin.p_WT)
    a = a + 2.0 * c.tip_damping_ratio * np.sqrt(c.tip_stiffness_per_s2) * (p.command.v_WTd - J @ p.v)
    posture = c.joint_stiffness_per_s2 * (p.q_ref - p.q)
    posture = posture + 2.0 * c.joint_damping_ratio * np.sqrt(c.joint_stiffness_per_s2) * (
        p.resolution.qdot - p.v
    )
    if p.rcm is None:
        return J, a, posture
    rate = p.rcm.jacobian @ p.v - p.kin.R_WT[:, :2].T @ p.v_WC
    shaft = -rcm_bias - c.rcm_stiffness_per_s2 * p.rcm.error
    shaft = shaft - 2.0 * c.rcm_damping_ratio * np.sqrt(c.rcm_stiffness_per_s2) * rate
    return np.vstack([J, p.rcm.jacobian]), np.concatenate([a, shaft]), posture


@cases
def test_the_terms_sum_to_the_inverse_dynamics_of_the_constrained_acceleration(arm, problem):
    """M q'' + bias + D v - d, with q'' from the KKT system of min |q'' - posture|_M subject to J q'' = a."""
    p, d = problem, np.linspace(-2.0, 2.0, 7)
    J, a, posture = _wanted(arm, p, SOFT)
    M, r = p.dyn.mass_matrix, len(J)
    K = np.block([[M, -J.T], [J, np.zeros((r, r))]])
    solution = np.linalg.solve(K, np.concatenate([M @ posture, a]))
    qddot, force = solution[:7], solution[7:]
    np.testing.assert_allclose(J @ qddot, a, atol=1e-8)
    terms, _ = KNOWN.build(arm).torque(p, _memory(d))
    expected = np.zeros((6, 7))
    expected[0], expected[1] = J[:3].T @ force[:3], J[3:].T @ force[3:]
    expected[2] = M @ posture
    expected[3], expected[4] = p.dyn.bias + arm.damping * p.v, -d
    np.testing.assert_allclose(terms, expected, atol=1e-4 * max(1.0, np.abs(force).max()))
    total = M @ qddot + p.dyn.bias + arm.damping * p.v - d
    np.testing.assert_allclose(terms.sum(axis=0), total, atol=1e-4)
    assert (np.abs(total) < arm.limits.torque).all()


def test_its_terms_are_named(arm):
    assert SOFT.build(arm).terms == TERMS


@cases
def test_under_a_limit_the_sum_keeps_it_and_the_limits_term_is_what_gave_way(arm, problem):
    p = replace(problem, command=replace(problem.command, a_WTd=np.array([300.0, 200.0, -300.0])))
    free, _ = SOFT.build(arm).torque(problem, None)
    np.testing.assert_array_equal(free[TERMS.index("limits")], 0.0)
    terms, _ = SOFT.build(arm).torque(p, None)
    limits = terms[TERMS.index("limits")]
    assert np.abs(limits).max() > 1.0
    assert (np.abs(terms.sum(axis=0)) <= arm.limits.torque).all()
    assert (np.abs(terms.sum(axis=0) - limits) > arm.limits.torque).any()
    if p.rcm is not None:
        J, a, _ = _wanted(arm, p, SOFT)
        qddot = np.linalg.solve(p.dyn.mass_matrix, terms.sum(axis=0) - p.dyn.bias - arm.damping * p.v)
        np.testing.assert_allclose(J[3:] @ qddot, a[3:], atol=1e-4 * max(1.0, np.abs(a[3:]).max()))


def _stepped(arm, p, torques):
    """The nominal arm in MuJoCo under one torque after the other."""
    scene = build(SceneConfig(robot=RobotConfig(name="lwr4plus"), theatre=False))
    plant = DynamicPlantConfig().build(scene, p.dt_s, (), np.random.SeedSequence(0))
    plant.reset(p.q)
    plant.set_velocity(p.v)
    for torque in torques:
        state = plant.step(torque, np.zeros(7))
    return state.q, state.v


@pytest.mark.parametrize("seed", range(4))
def test_prediction_is_where_the_nominal_arm_gets_to(arm, torque_problem, seed):
    p, rng = torque_problem(seed), np.random.default_rng(seed)
    torques = p.dyn.bias + rng.uniform(-3.0, 3.0, (5, 7))
    q, v = predict(p, torques, np.zeros(7), arm.damping)
    q_true, v_true = _stepped(arm, p, torques)
    moved, sped = np.abs(q_true - p.q).max(), np.abs(v_true - p.v).max()
    assert moved > 1e-4
    np.testing.assert_allclose(q, q_true, atol=0.02 * moved)
    np.testing.assert_allclose(v, v_true, atol=0.02 * sped)
    worse = np.abs(p.q + 5 * p.dt_s * p.v - q_true).max()  # than to coast on
    assert np.abs(q - q_true).max() < 0.2 * worse


def test_prediction_takes_the_known_disturbance_in(arm, torque_problem):
    p, d = torque_problem(0), np.linspace(-3.0, 3.0, 7)
    torques = np.tile(p.dyn.bias, (5, 1))
    with_d = predict(p, torques, d, arm.damping)
    np.testing.assert_allclose(with_d, predict(p, torques + d, np.zeros(7), arm.damping), atol=1e-12)
    assert np.abs(with_d[1] - predict(p, torques, np.zeros(7), arm.damping)[1]).max() > 1e-3


@cases
def test_with_a_delay_it_acts_on_the_state_when_the_torque_will_act(arm, problem):
    """The same as without a delay there and then: state, command, reference and trocar three ticks on."""
    p, ticks = problem, 3
    rng = np.random.default_rng(0)
    commands = p.dyn.bias + rng.uniform(-3.0, 3.0, (25, 7))
    p = replace(p, tau_measured=commands[ticks])
    late, _ = KNOWN.build(arm).torque(p, _memory(commands=commands))
    q, v = predict(p, commands[:ticks][::-1], np.zeros(7), arm.damping)
    kin, dyn = arm.evaluate(q, v)
    dt, c = ticks * p.dt_s, p.command
    p_WC = p.p_WC + dt * p.v_WC
    ahead = replace(
        p,
        q=q,
        v=v,
        kin=kin,
        dyn=dyn,
        p_WC=p_WC,
        rcm=None if p.rcm is None else rcm_kinematics(kin, p_WC, p.v_WC),
        command=replace(
            c, p_WTd=c.p_WTd + dt * c.v_WTd + 0.5 * dt * dt * c.a_WTd, v_WTd=c.v_WTd + dt * c.a_WTd
        ),
        q_ref=p.q_ref + dt * p.resolution.qdot,
    )
    there, _ = SOFT.build(arm).torque(ahead, None)
    # the command is extrapolated with T^2 / 2 of its acceleration
    np.testing.assert_allclose(late, there, atol=1e-6)
    now, _ = SOFT.build(arm).torque(p, None)
    assert np.abs(late - now).max() > 1e-2


@cases
def test_it_remembers_what_it_sent(arm, problem):
    law = RcmInverseDynamicsConfig().build(arm)
    terms, memory = law.torque(problem, None)
    np.testing.assert_allclose(_commands(memory)[0], terms.sum(axis=0), atol=1e-12)
    assert (np.abs(_commands(memory)[0]) <= arm.limits.torque).all()
    _, later = law.torque(problem, memory)
    np.testing.assert_array_equal(_commands(later)[1], _commands(memory)[0])


# Whole runs: a circle of 1 cm in two seconds.

RUN = (
    "theatre=false",
    "task.duration_s=1.8",
    "task.ramp_s=0.7",
    "task.hold_start_s=0.1",
    "task.hold_end_s=0.1",
    "task.radius_m=0.01",
)
MIXED = (
    "disturbances=[{type: payload, mass_kg: 0.2}, {type: joint_friction, coulomb_nm: 0.5}, "
    "{type: inertia_error, factor: 1.1}]"
)
PUSH = "disturbances=[{type: push, force_n: [5, 0, 0], start_s: 0.7, duration_s: 0.6}]"
DELAY = "disturbances=[{type: actuation_delay, delay_s: 0.005}]"
OTHER_DELAY = "disturbances=[{type: actuation_delay, delay_s: 0.01}]"
FAST = ("task.duration_s=0.35", "task.ramp_s=0.15", "task.hold_start_s=0.1", "task.hold_end_s=0.6")
NO_PREDICTION = "controller.torque_law.most_delay_ticks=0"


def _run(*changes, name="circle_lwr4plus", short=RUN, controller="rcm_inverse_dynamics"):
    return simulate(load_scenario(name, controller=controller, assignments=[*short, *changes]))


def _rms_mm(trace, column, after_s=0.0):
    return 1e3 * np.sqrt(np.mean(trace[column][trace["t_s"] >= after_s] ** 2))


def _max_mm(trace, column):
    return 1e3 * trace[column].max()


def _assert_nominal(trace):
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    assert _rms_mm(trace, "tip_error_m") <= 0.01
    assert _max_mm(trace, "rcm_error_m") <= 0.01


def _assert_rejects_mixed(trace):
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    assert _rms_mm(trace, "tip_error_m", 1.0) <= 0.1
    assert _rms_mm(trace, "rcm_error_m", 1.0) <= 0.05


@pytest.fixture(scope="module")
def nominal():
    return _run()


def test_a_nominal_run_is_exact(nominal):
    _assert_nominal(nominal)


def test_unknown_payload_friction_and_inertia_are_rejected():
    _assert_rejects_mixed(_run(MIXED))
    blind = _run(MIXED, "controller.torque_law.observer_gain=0")  # the observer does it
    assert _rms_mm(blind, "tip_error_m", 1.0) > 0.1


def test_the_observer_finds_the_payload_s_weight(nominal):
    trace = _run("disturbances=[{type: payload, mass_kg: 0.2}]")
    steady = trace.block("tau_observer_")[-1]
    without = nominal.block("tau_observer_")[-1]
    assert np.abs(steady).max() > 0.5
    assert np.abs(without).max() < 0.01


@pytest.mark.parametrize("at", ["tip", "elbow", "wrist"])
def test_a_push_of_5_n_moves_the_shaft_less_than_half_a_millimetre(at):
    trace = _run(PUSH.replace("duration_s", f"at: {at}, duration_s"))
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    assert 1e-4 < _max_mm(trace, "rcm_error_m") <= 0.5


@pytest.mark.parametrize("delay", [DELAY, OTHER_DELAY])
def test_a_delay_is_recognised_and_predicted_over(delay):
    _assert_nominal(_run(delay))


def test_without_the_prediction_a_delay_is_unstable():
    ending = _run(DELAY, NO_PREDICTION).meta.ending
    assert ending.outcome is not Outcome.COMPLETED
    assert ending.t_s < 1.0


def test_without_a_delay_the_prediction_changes_nothing(nominal):
    np.testing.assert_array_equal(_run(NO_PREDICTION).block("q"), nominal.block("q"))


def test_on_an_impossible_path_the_tip_gives_way_within_the_limits_and_the_rcm_does_not():
    trace = _run(name="sinusoid_lwr4plus", short=("theatre=false", *FAST))
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    limits = {name: np.array(values) for name, values in trace.meta.limits.items()}
    assert (np.abs(trace.block("tau")) <= limits["torque"]).all()
    assert (np.abs(trace.block("tau")) > 0.99 * limits["torque"]).any()
    assert (np.abs(trace.block("v")) <= limits["velocity"]).all()
    assert (trace.block("q") >= limits["q_min"]).all()
    assert (trace.block("q") <= limits["q_max"]).all()
    assert _max_mm(trace, "rcm_error_m") <= 0.2
    assert _max_mm(trace, "tip_error_m") > 10.0
    assert 1e3 * trace["tip_error_m"][-1] < 0.1  # and it comes back
    assert np.abs(trace.block("tau_limits_")).max() > 1.0
    assert np.nansum(trace["saturated_joints"]) == 0  # the law keeps them, not the plant


SCENARIOS = pytest.mark.parametrize("name", ["circle_lwr4plus", "sinusoid_lwr4plus", "spiral_lwr4plus"])


@pytest.mark.slow
@SCENARIOS
def test_nominal_in_full(name):
    _assert_nominal(_run(name=name, short=("theatre=false",)))


@pytest.mark.slow
@SCENARIOS
def test_mixed_disturbances_in_full(name):
    _assert_rejects_mixed(_run(MIXED, name=name, short=("theatre=false",)))


@pytest.mark.slow
@SCENARIOS
def test_push_in_full(name):
    push = PUSH.replace("start_s: 0.7, duration_s: 0.6", "start_s: 3.0, duration_s: 3.0")
    trace = _run(push, name=name, short=("theatre=false",))
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    assert _max_mm(trace, "rcm_error_m") <= 0.5


@pytest.mark.slow
@SCENARIOS
def test_delay_in_full(name):
    _assert_nominal(_run(DELAY, name=name, short=("theatre=false",)))
    unstable = _run(DELAY, NO_PREDICTION, name=name, short=("theatre=false",))
    assert unstable.meta.ending.outcome is not Outcome.COMPLETED
