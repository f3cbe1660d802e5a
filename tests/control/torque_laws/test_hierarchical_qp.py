"""The hierarchical QP: as the closed form without limits, inside every limit with them, and what it tells."""

import math
from dataclasses import replace

import numpy as np
import pytest

import surgsim
from surgsim.contract.problems import torque_problem as problem_of
from surgsim.control.acceleration import TORQUE_SHARE, fill_acceleration_bounds
from surgsim.control.barriers import fill_entry_barrier
from surgsim.control.planes import PlaneConfig
from surgsim.control.rcm import rcm_kinematics
from surgsim.control.seen import new_seen
from surgsim.control.torque_laws.base import seen_of_torque
from surgsim.control.torque_laws.hierarchical_qp import TERMS, HierarchicalQpConfig
from surgsim.control.torque_laws.rcm_inverse_dynamics import RcmInverseDynamicsConfig
from surgsim.errors import Outcome
from surgsim.models.arm import ArmModel
from surgsim.models.config import RobotConfig, SceneConfig
from surgsim.tick.nominal import copy_model

N, DT = 7, 0.001
PLAIN = RcmInverseDynamicsConfig(observer_gain=0.0, most_delay_ticks=0)
SOFT = {"rcm_stiffness_per_s2": 400.0, "tip_stiffness_per_s2": 90.0, "joint_stiffness_per_s2": 30.0}
"""Gains with which the random problems reach no limit."""


def terms_of(config, arm, p, memory=None):
    return config.build(arm).torque(p, memory)[0]


def acceleration(arm, p, torque):
    return np.linalg.solve(p.dyn.mass_matrix, torque - p.dyn.bias - arm.damping * p.v)


@pytest.mark.parametrize("trocar", [True, False])
def test_without_active_limits_it_is_rcm_inverse_dynamics_without_its_observer(arm, trocar):
    worst, compared = 0.0, 0
    for seed in range(60):
        p = problem_of(arm, seed, trocar=trocar)
        closed = terms_of(PLAIN.model_copy(update=SOFT), arm, p)
        if np.abs(closed[5]).max() > 0.0:
            continue
        ours = terms_of(HierarchicalQpConfig(**SOFT), arm, p)
        np.testing.assert_array_equal(ours[TERMS.index("relaxed")], 0.0)
        np.testing.assert_allclose(ours[TERMS.index("limits")], 0.0, atol=1e-9)
        worst, compared = max(worst, np.abs(ours.sum(axis=0) - closed.sum(axis=0)).max()), compared + 1
    assert compared > 50
    assert worst < 1e-6


def test_a_whole_run_with_its_observer_is_the_run_of_rcm_inverse_dynamics():
    """Payload, friction, wrong inertia and a delay: what differs is not the QP."""
    disturbances = "[{type: payload}, {type: joint_friction}, {type: inertia_error}, {type: actuation_delay}]"
    settings = {"disturbances": surgsim_yaml(disturbances), "task.duration_s": 2.0}
    runs = [
        surgsim.run(
            "circle_lwr4plus",
            controller="rcm_inverse_dynamics",
            settings={**settings, "controller.torque_law": law},
        ).trace
        for law in (
            {"type": "rcm_inverse_dynamics"},
            {"type": "hierarchical_qp", "observer": "momentum"},
            {"type": "hierarchical_qp"},
        )
    ]
    assert runs[0].meta.ending.outcome is runs[1].meta.ending.outcome is Outcome.COMPLETED
    np.testing.assert_allclose(runs[1].block("q"), runs[0].block("q"), rtol=0, atol=1e-8)
    assert runs[2].meta.ending.outcome is not Outcome.COMPLETED  # 5 ms are too much for these gains


def surgsim_yaml(text):
    from surgsim.scenario.yaml_text import parse_yaml

    return parse_yaml(f"x: {text}", "text").tree["x"]


def test_the_weighted_law_is_the_ridge_solution(arm):
    c = HierarchicalQpConfig(mode="weighted", posture_weight=1e-3, **SOFT)
    for seed in range(10):
        p = problem_of(arm, seed)
        closed = terms_of(PLAIN.model_copy(update=SOFT), arm, p)
        asked = acceleration(arm, p, closed.sum(axis=0))
        J = np.vstack([p.kin.Jv_WT, p.rcm.jacobian])
        M, w = p.dyn.mass_matrix, np.array([1.0, 1.0, 1.0, 10.0, 10.0])
        posture = np.linalg.solve(M, closed[2])
        H = J.T @ (w[:, None] * J) + 1e-3 * M
        expected = np.linalg.solve(H, J.T @ (w * (J @ asked)) + 1e-3 * M @ posture)
        ours = terms_of(c, arm, p)
        np.testing.assert_allclose(
            acceleration(arm, p, ours.sum(axis=0)), expected, rtol=1e-6, atol=1e-5 * np.abs(expected).max()
        )
        assert np.abs(expected - asked).max() > 1e-3


def random_demands(arm, count):
    """States anywhere in range and speed, with demands that pass limits."""
    rng, limits = np.random.default_rng(0), arm.limits
    middle, half = 0.5 * (limits.q_min + limits.q_max), 0.5 * (limits.q_max - limits.q_min)
    for seed in range(count):
        p = problem_of(arm, seed % 50)
        q, v = middle + half * rng.uniform(-0.99, 0.99, N), 0.9 * limits.velocity * rng.uniform(-1, 1, N)
        kin, dyn = arm.evaluate(q, v)
        p_WC = kin.p_WT - 0.2 * kin.R_WT[:, 2]
        command = replace(
            p.command, p_WTd=kin.p_WT + 0.02 * rng.standard_normal(3), a_WTd=30.0 * rng.standard_normal(3)
        )
        yield replace(
            p,
            q=q,
            v=v,
            kin=kin,
            dyn=dyn,
            rcm=rcm_kinematics(kin, p_WC, p.v_WC),
            p_WC=p_WC,
            command=command,
            q_ref=q + 0.05 * rng.standard_normal(N),
            tau_measured=dyn.bias + rng.uniform(-2.0, 2.0, N),
        )


@pytest.mark.parametrize("mode", ["strict", "weighted"])
@pytest.mark.parametrize("rate", [None, 200.0, 5e4])
def test_every_limit_holds_or_is_told(arm, mode, rate):
    config = HierarchicalQpConfig(mode=mode, torque_rate_nm_per_s=rate)
    limited = told = 0
    low, high = np.empty(N), np.empty(N)
    for p in random_demands(arm, 100):
        terms = terms_of(config, arm, p)
        tau = terms.sum(axis=0)
        most = TORQUE_SHARE * arm.limits.torque
        assert (np.abs(tau) <= most + 1e-6).all()
        if rate is not None:
            last = np.clip(p.tau_measured, -most, most)
            assert (np.abs(tau - last) <= rate * DT + 1e-6).all()
        seen = new_seen(arm, dt_s=DT, has_trocar=False)
        fill_acceleration_bounds(seen, p.q, p.v, low, high)
        qddot, slack = acceleration(arm, p, tau), 1e-6 * (1.0 + np.abs(high) + np.abs(low))
        kept = (qddot <= high + slack).all() and (qddot >= low - slack).all()
        relaxed = np.abs(terms[TERMS.index("relaxed")]).max()
        assert kept or relaxed > 0.0
        told += relaxed > 1e-6
        limited += np.abs(terms[TERMS.index("limits")]).max() > 1e-3
        np.testing.assert_allclose(
            terms[TERMS.index("relaxed")],
            p.dyn.mass_matrix @ (qddot - np.clip(qddot, low, high)) if relaxed > 0.0 else 0.0,
            atol=1e-4,
        )
    assert limited > 50
    assert (told > 20) if rate == 200.0 else (told < 100)
    assert told == 0 or rate is not None  # torques alone leave room for the joints' own limits


@pytest.mark.parametrize("mode", ["strict", "weighted"])
def test_its_command_never_changes_faster_than_the_drives_take(mode):
    settings = {
        "robot.drive.torque_rate_nm_per_s": 60.0,
        "task.duration_s": 3.0,
        "controller.torque_law.mode": mode,
    }
    trace = surgsim.run("circle_panda", controller="hierarchical_qp", settings=settings).trace
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    changes = np.abs(np.diff(trace.block("tau"), axis=0))[:-1]
    assert changes.max() <= 0.06 * (1.0 + 1e-6)
    assert changes.max() > 0.0599
    terms = sum(trace.block(f"tau_{term}_") for term in TERMS)
    np.testing.assert_allclose(terms[:-1], trace.block("tau")[:-1], atol=1e-9)


def test_on_an_impossible_path_strict_priority_gives_the_tip_up_and_the_rcm_not():
    fast = {"task.duration_s": 0.35, "task.ramp_s": 0.15, "task.hold_start_s": 0.1, "task.hold_end_s": 0.6}
    traces = {
        mode: surgsim.run(
            "sinusoid_lwr4plus",
            controller="hierarchical_qp",
            settings={**fast, "theatre": False, "controller.torque_law.mode": mode},
        ).trace
        for mode in ("strict", "weighted")
    }
    for trace in traces.values():
        limits = {name: np.array(values) for name, values in trace.meta.limits.items()}
        assert trace.meta.ending.outcome is Outcome.COMPLETED
        assert (np.abs(trace.block("tau")) <= limits["torque"]).all()
        assert (np.abs(trace.block("tau")) > 0.99 * limits["torque"]).any()
        assert (np.abs(trace.block("v")) <= limits["velocity"]).all()
        assert 1e3 * trace["tip_error_m"].max() > 10.0
    strict, weighted = (1e3 * traces[mode]["rcm_error_m"].max() for mode in ("strict", "weighted"))
    assert strict < 0.2
    assert weighted > 2.0 * strict


def test_on_real_drives_no_bandwidth_is_past_its_share(arm):
    on_drives = ArmModel(SceneConfig(robot=RobotConfig(name="panda", drive="real")))
    free, config = on_drives.locked_frequency, HierarchicalQpConfig(drive_share=0.1, drive_damping_ratio=0.6)
    bounded, own = config.build(on_drives).gains[:6], config.build(arm).gains[:6]
    assert bounded[:4] == pytest.approx([(0.1 * free) ** 2, 1.2 * 0.1 * free] * 2)
    assert own == pytest.approx([2e4, 2.0 * math.sqrt(2e4), 1e4, 200.0, 100.0, 20.0])


RADIUS = 0.0005


def held(law, name="circle_lwr4plus", duration_s=4.0, **settings):
    """A run in which the tip alone is a task, without the pull towards the port."""
    law = {"type": "hierarchical_qp", "joint_stiffness_per_s2": 0.0, **law}
    given = {"controller.torque_law": law, "task.duration_s": duration_s, "controller.resolver.alpha": 1.0}
    return surgsim.run(name, controller="entry_sphere_qp", settings={**given, **settings}).trace


def test_the_sphere_holds_to_a_micrometre_at_torque_level():
    free, inside = (held({"entry_radius_m": radius}) for radius in (1.0, RADIUS))
    assert free.meta.ending.outcome is inside.meta.ending.outcome is Outcome.COMPLETED
    assert free["rcm_error_m"].max() > 3.0 * RADIUS
    assert inside["rcm_error_m"].max() <= RADIUS + 1e-6
    assert inside["rcm_error_m"].max() > 0.99 * RADIUS
    assert inside["tip_error_m"].max() < 1e-5
    assert np.abs(inside.block("tau_limits_")).max() > 1e-3
    np.testing.assert_array_equal(inside.block("tau_relaxed_"), 0.0)


def test_the_tip_comes_to_rest_on_a_wall():
    plane = {"normal": [-1.0, 0.0, 0.0], "offset_m": -0.0}
    trace = held({"planes": [plane]}, **{"safety.tip_error_max_m": None})
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    assert trace.block("tip")[:, 0].min() > -1e-5
    assert trace.block("tip")[:, 0].min() < 1e-4
    assert trace.block("tip_ref")[:, 0].min() < -0.01


def test_a_sphere_that_gives_way_to_the_torque_s_rate_is_told(arm):
    """`relaxed` is the least torque that would bring the shaft's acceleration back to its bound."""
    tight = HierarchicalQpConfig(entry_radius_m=1e-4, torque_rate_nm_per_s=1.0)  # 2 mm from the port
    told, row = 0, np.empty(N)
    for seed in range(20):
        p = problem_of(arm, seed)
        p = replace(p, tau_measured=p.dyn.bias)
        terms = terms_of(tight, arm, p)
        relaxed = terms[TERMS.index("relaxed")]
        seen = seen_of_torque(p, arm)
        copy_model(seen, seen.elsewhere)
        most = fill_entry_barrier(seen, seen.elsewhere, 0.0, 1e-4, np.array([20.0, 100.0]), row)
        beyond = row @ acceleration(arm, p, terms.sum(axis=0)) - most
        back = row @ np.linalg.solve(p.dyn.mass_matrix, relaxed)
        assert back == pytest.approx(max(beyond, 0.0), rel=1e-4, abs=1e-6)
        told += beyond > 1e-3
        loose = terms_of(HierarchicalQpConfig(entry_radius_m=1e-2, **SOFT), arm, p)
        np.testing.assert_array_equal(loose[TERMS.index("relaxed")], 0.0)
    assert 5 < told < 20


def test_a_wall_s_row_is_kept(arm):
    p = problem_of(arm, 1)
    n = np.array([0.0, 0.6, 0.8])
    wall = PlaneConfig(normal=(0.0, 3.0, 4.0), offset_m=float(n @ p.kin.p_WT) - 0.001)  # the tip is past it
    terms = terms_of(HierarchicalQpConfig(planes=(wall,)), arm, p)
    h, v = 1e-4, p.v
    positions = [arm.kinematics(p.q + v * t).p_WT for t in (-h, 0.0, h)]
    bias = (positions[0] - 2.0 * positions[1] + positions[2]) / h**2
    a = n @ (p.kin.Jv_WT @ acceleration(arm, p, terms.sum(axis=0)) + bias)
    most = -0.001 * 2000.0 - 120.0 * n @ p.kin.Jv_WT @ v
    assert a <= most + 1e-4


def test_following_the_gears_needs_a_short_period():
    with pytest.raises(surgsim.SurgsimError, match=r"control_period_s of at most 0\.004"):
        surgsim.load(
            "circle_lwr4plus", controller="entry_sphere_qp", settings={"simulation.control_period_s": 0.005}
        )


@pytest.mark.parametrize("controller", ["hierarchical_qp", "entry_sphere_qp"])
def test_it_lives_in_the_theatre_on_real_drives(controller):
    settings = {"task.duration_s": 2.0, "task.radius_m": 0.005}
    trace = surgsim.run("theatre_fr3", controller=controller, settings=settings).trace
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    assert 1e3 * trace["rcm_error_m"].max() < {"hierarchical_qp": 1.5, "entry_sphere_qp": 0.6}[controller]
