"""The self-motion resolver: within every limit, on the path, and at the optimum in the end."""

from dataclasses import replace

import numpy as np
import pytest

from surgsim.control.failure import ControlFailure
from surgsim.control.resolvers.self_motion import SelfMotionConfig
from surgsim.control.self_motion import SelfMotion
from surgsim.errors import Outcome
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import simulate

P_WC = np.array([0.0, 0.55, 0.2])
P_WT = np.array([0.02, 0.55, 0.02])
HOME = np.array([1.5708, -0.5236, 0.0, 1.5708, 0.0, -1.0472, 0.0])
SHORT = ("theatre=false", "task.duration_s=2.5", "task.radius_m=0.005", "plant={type: kinematic}")


@pytest.fixture(scope="module")
def far(arm):
    """A start with little manipulability: the elbow turned far from the optimum."""
    manifold = SelfMotion(arm)
    here = manifold.project(HOME, P_WT, P_WC, steps=30)
    curve = manifold.swivel_curve(here.q, P_WT, P_WC)
    return curve[len(curve) // 5]


def _run(far, *changes):
    start = f"start={{q_rad: {far.q.tolist()}}}"
    scenario = load_scenario(
        "circle_lwr4plus", controller="self_motion", assignments=[*SHORT, start, *changes]
    )
    return simulate(scenario)


@pytest.fixture(scope="module", params=["trocar", "no trocar"])
def run(request, far):
    return _run(far, *([] if request.param == "trocar" else ["trocar=null"]))


def test_the_run_completes_with_every_limit_kept(run):
    assert run.meta.ending.outcome is Outcome.COMPLETED
    limits = {name: np.array(values) for name, values in run.meta.limits.items()}
    q, qdot = run.block("q"), np.vstack([np.zeros(7), run.block("qdot_ref")])
    assert (q >= limits["q_min"]).all()
    assert (q <= limits["q_max"]).all()
    assert (np.abs(qdot) <= limits["velocity"]).all()
    ratio = np.abs(np.diff(qdot, axis=0)) / 0.001 / limits["acceleration"]
    assert ratio.max() <= 1.0 + 1e-9
    assert ratio.max() > 0.5  # it uses what it may


def test_tip_and_shaft_stay_where_they_belong(run):
    assert run["tip_error_m"].max() <= 1e-5
    assert run["resolver_residual_m_per_s"].max() < 1e-9
    if run.meta.scenario["trocar"] is not None:
        assert run["rcm_error_m"].max() <= 1e-5


def test_it_ends_at_the_optimum(arm, run, far):
    p_WC = None if run.meta.scenario["trocar"] is None else P_WC
    manifold = SelfMotion(arm, margin_rad=0.0)
    p_WT = run.block("tip")[-1]
    here = manifold.project(run.block("q")[-1], p_WT, p_WC)
    best = max(manifold.climb(here.q, p_WT, p_WC).mu, far.mu)
    assert run["manipulability"][0] < 0.9 * best
    assert run["manipulability"][-1] > 0.99 * best
    if p_WC is not None:  # and it is the largest of the swivel curve
        curve = manifold.swivel_curve(here.q, p_WT, p_WC)
        assert run["manipulability"][-1] > 0.99 * max(point.mu for point in curve)


def test_the_way_to_the_optimum_is_uphill(run):
    mu = run["manipulability"]
    assert mu[::50].min() >= 0.9 * mu[0]


def test_second_order_feed_forward_keeps_the_path_better_than_a_tangent_step(far):
    """The pseudo-inverse without it drifts off by a period's curvature."""
    exact = _run(far, "task.duration_s=1", "task.ramp_s=0.3", "controller.resolver.k_tip=0")
    tangent = _run(
        far, "task.duration_s=1", "task.ramp_s=0.3", "controller.resolver={type: gradient, k_tip: 0}"
    )
    assert exact["tip_error_m"].max() < 0.2 * tangent["tip_error_m"].max()


def test_what_omega_cannot_meet_is_an_outcome(arm, velocity_problem):
    p = velocity_problem(0, speed=50.0, rcm_error_m=0.0, trocar_speed=0.0)
    resolver = SelfMotionConfig(search_starts=0).build(arm)
    with pytest.raises(ControlFailure, match="no joint velocity inside Omega") as failure:
        resolver.step(p, resolver.start(p))
    assert failure.value.outcome is Outcome.INFEASIBLE
    assert sorted(failure.value.data) == ["J", "lower", "rhs", "upper"]


def test_a_stretched_arm_is_an_outcome(arm, velocity_problem):
    p = velocity_problem(0, q=np.zeros(7), rcm_error_m=0.0, trocar_speed=0.0)
    resolver = SelfMotionConfig(search_starts=0).build(arm)
    with pytest.raises(ControlFailure, match="the task Jacobian has lost rank") as failure:
        resolver.step(p, resolver.start(p))
    assert failure.value.outcome is Outcome.INFEASIBLE


def test_at_rest_at_the_optimum_nothing_moves(arm, velocity_problem, far):
    manifold = SelfMotion(arm)
    top = manifold.climb(HOME, P_WT, P_WC)
    p = velocity_problem(0, q=top.q, rcm_error_m=0.0, trocar_speed=0.0, speed=0.0)
    still = replace(p.command, p_WTd=top.kin.p_WT, v_WTd=np.zeros(3), a_WTd=np.zeros(3))
    p = replace(p, v=np.zeros(7), command=still)
    resolver = SelfMotionConfig(search_starts=0).build(arm)
    answer, _ = resolver.step(p, resolver.start(p))
    assert np.abs(answer.qdot).max() < 1e-4
