"""Null-space motion away from joint limits: the formula, and what it does to runs that begin near one."""

from dataclasses import replace

import numpy as np
import pytest

import surgsim
from surgsim.catalog import PartConfig
from surgsim.control.limit_avoidance import GAIN_PER_S, fill_avoidance, keep_from_limits
from surgsim.control.redundancy import shares_null_space
from surgsim.control.resolvers import RESOLVERS
from surgsim.control.resolvers.hands_on import HandsOnConfig
from surgsim.control.resolvers.pinv import PinvConfig
from surgsim.control.resolvers.policy import PolicyConfig
from surgsim.control.resolvers.qp import QpConfig
from surgsim.control.resolvers.self_motion import SelfMotionConfig
from surgsim.control.seen import fill_kinematics, new_seen, seen_of_velocity, velocity_problem_of
from surgsim.control.self_motion import SelfMotion
from surgsim.models.arm import ArmModel
from surgsim.scenario.load import load_scenario
from surgsim.tick.arrays import Resolved, new
from surgsim.tick.fields import fields_of

N, ZONE = 7, 0.2
SHARING = {"gradient", "mink", "pinv", "rnn", "vprnn"}


def _near_limits(arm, seed, has_trocar=True):
    """Seen with about half of the joints inside their zones, and an answer inside Omega."""
    rng, limits = np.random.default_rng(seed), arm.limits
    room = rng.uniform(0.02, 2.0 * ZONE, N)
    q = np.where(rng.random(N) < 0.5, limits.q_min + room, limits.q_max - room)
    seen = new_seen(arm, dt_s=0.001, has_trocar=has_trocar)
    seen.q[:] = q
    fill_kinematics(seen, arm.kinematics(q))
    seen.J_rcm[:] = rng.standard_normal((2, N))
    seen.lower[:], seen.upper[:] = -limits.velocity, limits.velocity
    seen.limit_zone = ZONE
    out = new(Resolved, N)
    out.qdot[:] = rng.uniform(-0.1, 0.1, N)
    return seen, out


def _field(seen):
    below = np.maximum(ZONE - (seen.q - seen.q_min), 0.0)
    above = np.maximum(ZONE - (seen.q_max - seen.q), 0.0)
    return GAIN_PER_S * (below - above)


@pytest.mark.parametrize("has_trocar", [True, False])
@pytest.mark.parametrize("seed", range(10))
def test_what_is_added_is_the_field_in_the_null_space(arm, seed, has_trocar):
    seen, out = _near_limits(arm, seed, has_trocar)
    before = out.qdot.copy()
    keep_from_limits(seen, out)
    J = np.vstack((seen.Jv_WT, seen.J_rcm)) if has_trocar else seen.Jv_WT
    expected = (np.eye(N) - np.linalg.pinv(J) @ J) @ _field(seen)
    np.testing.assert_allclose(out.qdot - before, expected, atol=1e-10)
    assert np.abs(expected).max() > 1e-3
    np.testing.assert_allclose(J @ out.qdot, J @ before, atol=1e-10)


@pytest.mark.parametrize("seed", range(10))
def test_a_roll_that_is_a_task_is_held_too(arm, seed):
    seen, _ = _near_limits(arm, seed)
    J = np.vstack((seen.Jv_WT, seen.J_rcm, seen.R_WT[:, 2] @ seen.Jw_WT))
    away = np.empty(N)
    assert fill_avoidance(seen, True, away)
    np.testing.assert_allclose(away, (np.eye(N) - np.linalg.pinv(J) @ J) @ _field(seen), atol=1e-9)
    seen.limit_zone = 0.0
    assert not fill_avoidance(seen, True, away)


@pytest.mark.parametrize("seed", range(10))
def test_it_is_shortened_to_stay_inside_omega_and_never_turned(arm, seed):
    seen, whole = _near_limits(arm, seed)
    out = new(Resolved, N)
    out.qdot[:] = before = whole.qdot.copy()
    keep_from_limits(seen, whole)
    added = whole.qdot - before
    joint = np.abs(added).argmax()
    seen.lower[joint] = before[joint] - 0.3 * abs(added[joint])
    seen.upper[joint] = before[joint] + 0.3 * abs(added[joint])
    keep_from_limits(seen, out)
    np.testing.assert_allclose(out.qdot - before, 0.3 * added, atol=1e-10)
    seen.lower[:] = seen.upper[:] = out.qdot[:] = before
    keep_from_limits(seen, out)
    np.testing.assert_array_equal(out.qdot, before)


def test_outside_the_zones_every_bit_of_the_answer_stays(arm):
    seen, out = _near_limits(arm, 0)
    seen.q[:] = 0.5 * (arm.limits.q_min + arm.limits.q_max)
    before = out.qdot.copy()
    keep_from_limits(seen, out)
    np.testing.assert_array_equal(out.qdot, before)


def test_a_short_range_keeps_half_of_itself_free(arm):
    seen, out = _near_limits(arm, 0)
    seen.q_min[:], seen.q_max[:] = seen.q - 0.1, seen.q + 0.1
    before = out.qdot.copy()
    keep_from_limits(seen, out)
    np.testing.assert_array_equal(out.qdot, before)


def test_an_answer_stays_where_the_rows_have_lost_rank(arm):
    seen, out = _near_limits(arm, 0)
    seen.J_rcm[1] = seen.J_rcm[0] = 0.0
    before = out.qdot.copy()
    keep_from_limits(seen, out)
    np.testing.assert_array_equal(out.qdot, before)


def test_a_resolver_that_is_called_from_python_knows_the_zone_too(arm, velocity_problem):
    q = np.where(np.arange(N) == 1, arm.limits.q_max - 0.05, velocity_problem(0).q)
    near = velocity_problem(0, q=q)
    resolver = QpConfig(acceleration_limit=False).build(arm)
    plain, _ = resolver.step(near, None)
    led, _ = resolver.step(replace(near, limit_zone_rad=ZONE), None)
    assert np.abs(led.qdot - plain.qdot).max() > 1e-3
    seen = seen_of_velocity(replace(near, limit_zone_rad=ZONE), arm)
    assert velocity_problem_of(fields_of(seen), arm.limits).limit_zone_rad == ZONE


def test_which_resolvers_share_their_null_space():
    shipped = {name for name in RESOLVERS.names() if shares_null_space(RESOLVERS.config(name)())}
    assert shipped == SHARING | {"hands_on", "policy"}
    assert shares_null_space(HandsOnConfig()), "its pseudo-inverse does"
    assert not shares_null_space(HandsOnConfig(resolver=SelfMotionConfig()))
    assert shares_null_space(PolicyConfig(resolver=PinvConfig()))
    assert not shares_null_space(PolicyConfig(action="joint_velocity"))
    assert not shares_null_space(PartConfig()), "a resolver that says nothing is left alone"


@pytest.fixture(scope="module", params=["lwr4plus", "panda", "fr3", "iiwa14"])
def edge(request):
    """A circle, and the end of the elbow's way at its start: 0.02 rad before a joint's limit."""
    scenario = load_scenario(f"circle_{request.param}")
    arm = ArmModel(scenario.scene)
    q = surgsim.run(scenario, task={"duration_s": 2.0}).trace.block("q")[0]
    curve = SelfMotion(arm, margin_rad=0.02).swivel_curve(
        q, arm.kinematics(q).p_WT, np.array(scenario.trocar.position_m)
    )
    return request.param, arm, curve[-1].q


def _run(edge, controller, zone):
    name, arm, q = edge
    settings = {"start.q_rad": q.tolist(), "controller.limit_zone_rad": zone}
    run = surgsim.run(f"circle_{name}", controller=controller, settings=settings)
    q = run.trace.block("q")
    return run, np.minimum(q - arm.limits.q_min, arm.limits.q_max - q).min(axis=1)


@pytest.mark.parametrize("controller", ["pinv", "qp", "vprnn", "mink", "vector_field_inequalities"])
def test_a_run_that_begins_near_a_limit_leaves_it(edge, controller):
    (run, room), (_, left_alone) = _run(edge, controller, ZONE), _run(edge, controller, 0.0)
    assert room[0] < 0.04
    assert run.outcome == "completed"
    assert room.min() > room[0] - 1e-3
    assert room[-1] > 0.19
    assert room[-1] > left_alone[-1] + 0.1


def test_tip_and_rcm_do_not_notice(edge):
    run, room = _run(edge, "rcm_inverse_dynamics", ZONE)
    assert run.outcome == "completed"
    assert room[-1] > 0.19
    assert run.metrics["tip_error_max_mm"] < 0.01
    assert run.metrics["rcm_error_max_mm"] < 0.001


def test_a_roll_near_the_last_joint_s_limit_is_followed_within_the_acceleration_limit():
    settings = {"task.roll": {"use": True}, "task.goals.0.roll_deg": 110.0}
    q = surgsim.run("teleop_free_motion_panda", task={"hold_end_s": 0.0}).trace.block("q")[0]
    settings["start.q_rad"] = [*q[:-1].tolist(), q[-1] + 0.85]
    run = surgsim.run("teleop_free_motion_panda", settings=settings)
    assert run.metrics["roll_error_rms_deg"] < 1.0
    assert run.metrics["acceleration_limit_ratio"] < 1.0 + 1e-6


NEAR = {
    "lwr4plus": (2002, 2003, 2011, 2021, 2026, 2030, 2031, 2033),
    "panda": (2015,),
    "fr3": (2014,),
    "iiwa14": (2002, 2003, 2011, 2016, 2021, 2023, 2030, 2033),
}
"""Seeds from 2000 to 2039 of the random scenarios whose runs come within 0.2 rad of a limit."""


@pytest.mark.slow
def test_the_room_that_is_left_is_mostly_what_geometry_allows():
    lacking = []
    for name, seeds in NEAR.items():
        for seed in seeds:
            run = surgsim.run(f"random_{name}", controller="rcm_inverse_dynamics", seed=seed)
            arm, port = ArmModel(run.scenario.scene), np.array(run.scenario.trocar.position_m)
            low, high = arm.limits.q_min, arm.limits.q_max
            room = np.minimum(run.trace.block("q") - low, high - run.trace.block("q")).min(axis=1)
            assert room.min() < 0.2
            q = run.trace.block("q")[room.argmin()]
            curve = SelfMotion(arm, margin_rad=0.0).swivel_curve(
                q, arm.kinematics(q).p_WT, port, step_rad=0.01
            )
            most = max(min((point.q - low).min(), (high - point.q).min()) for point in curve)
            lacking.append(most - room.min())
    assert sum(gap < 1e-3 for gap in lacking) >= 14
    assert max(lacking) < 0.1
