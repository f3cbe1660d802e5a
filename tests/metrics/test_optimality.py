"""The share of the attainable manipulability, against brute force over the swivel curve."""

import numpy as np
import pytest

from surgsim.control.self_motion import SelfMotion
from surgsim.metrics.catalog import METRICS
from surgsim.metrics.metric import Undefined
from surgsim.metrics.optimality import (
    SAMPLES,
    _search,
    attainable_manipulability,
    manipulability_optimality,
)
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import simulate
from surgsim.trace.trace import Trace

P_WC = np.array([0.0, 0.55, 0.2])
P_WT = np.array([0.02, 0.55, 0.02])
HOME = np.array([1.5708, -0.5236, 0.0, 1.5708, 0.0, -1.0472, 0.0])
KINEMATIC = "plant={type: kinematic}"


@pytest.fixture(scope="module")
def curve(arm):
    manifold = SelfMotion(arm, margin_rad=0.0)
    here = manifold.project(HOME, P_WT, P_WC, steps=30)
    return manifold.swivel_curve(here.q, P_WT, P_WC, step_rad=0.005)


def _run(*changes, q=None, controller="pinv"):
    start = [] if q is None else [f"start={{q_rad: {q.tolist()}}}"]
    short = ("theatre=false", "task.duration_s=0.8", "task.ramp_s=0.3", "task.radius_m=0.01")
    scenario = load_scenario(
        "circle_lwr4plus", controller=controller, assignments=[*short, KINEMATIC, *start, *changes]
    )
    return simulate(scenario)


def _held(trace, rows):
    """A trace that stays in the first row's state."""
    return Trace(np.repeat(trace.data[:1], rows, axis=0), trace.blocks, trace.meta)


@pytest.mark.parametrize("share", [0.1, 0.35, 0.7, 0.95])
def test_of_a_held_posture_it_is_mu_over_the_largest_of_the_swivel_curve(arm, curve, share):
    q = curve[round(share * (len(curve) - 1))].q
    trace = _held(_run("task.radius_m=0.001", q=q), 40)
    mu = np.array([np.prod(np.linalg.svd(arm.kinematics(p.q).Jv_WT, compute_uv=False)) for p in curve])
    here = np.prod(np.linalg.svd(arm.kinematics(q).Jv_WT, compute_uv=False))
    assert manipulability_optimality(trace) == pytest.approx(here / mu.max(), rel=1e-4)
    _, best = attainable_manipulability(trace)
    assert np.ptp(best) < 1e-6 * best[0]


def test_the_held_optimum_is_one(arm, curve):
    manifold = SelfMotion(arm, margin_rad=0.0)
    best = max(curve, key=lambda point: point.mu)
    top = manifold.climb(best.q, P_WT, P_WC)
    trace = _held(_run("task.radius_m=0.001", q=top.q), 10)
    assert manipulability_optimality(trace) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("controller", ["pinv", "gradient"])
@pytest.mark.parametrize("trocar", [True, False])
def test_no_run_is_above_one_anywhere(curve, controller, trocar):
    """Also at ticks between those where it is sampled by default."""
    q = curve[len(curve) // 4].q
    trace = _run(*([] if trocar else ["trocar=null"]), q=q, controller=controller)
    rows, best = attainable_manipulability(trace, 61)
    share = trace["manipulability"][rows] / best
    assert (share <= 1.0 + 1e-6).all()
    assert share.min() < 0.95
    whole = np.interp(np.arange(len(trace)), rows, best)
    assert manipulability_optimality(trace) == pytest.approx(
        (trace["manipulability"] / whole).mean(), abs=5e-4
    )


def test_along_a_path_it_is_the_largest_of_each_tick_s_own_curve(arm, curve):
    trace = _run(q=curve[len(curve) // 4].q)
    rows, best = attainable_manipulability(trace, 4)
    manifold = SelfMotion(arm, margin_rad=0.0)
    for row, found in zip(rows, best, strict=True):
        p_WT = trace.block("tip")[row]
        own = manifold.swivel_curve(trace.block("q")[row], p_WT, P_WC, step_rad=0.01)
        assert found == pytest.approx(max(point.mu for point in own), rel=1e-3)


def test_without_a_trocar_more_is_attainable(curve):
    q = curve[len(curve) // 4].q
    with_trocar, without = (
        attainable_manipulability(_held(_run("task.radius_m=0.001", *changes, q=q), 5))[1][0]
        for changes in ((), ("trocar=null",))
    )
    assert without > 1.01 * with_trocar


def test_it_is_sampled_from_the_first_tick_to_the_last():
    trace = _run()
    rows, best = attainable_manipulability(trace)
    assert (rows[0], rows[-1], len(rows)) == (0, len(trace) - 1, SAMPLES)
    assert best.shape == rows.shape
    rows, _ = attainable_manipulability(_held(trace, 3))  # shorter than the samples
    assert rows.tolist() == [0, 1, 2]


def test_the_runs_before_it_change_nothing(curve):
    """The optima at the start are kept for the runs of a batch; what is kept must be what would be found."""
    trace = _run(q=curve[len(curve) // 4].q)
    _search.cache_clear()
    alone = manipulability_optimality(trace)
    _search.cache_clear()
    for other in (_run(q=curve[len(curve) // 2].q), _run("trocar=null", q=curve[len(curve) // 4].q)):
        manipulability_optimality(other)
    assert manipulability_optimality(trace) == alone
    again = manipulability_optimality(_run(q=curve[len(curve) // 4].q, controller="gradient"))
    kept = _search.cache_info()
    assert (kept.misses, kept.hits) == (3, 1), "a run of another controller shares the start"
    _search.cache_clear()
    assert manipulability_optimality(_run(q=curve[len(curve) // 4].q, controller="gradient")) == again


def test_it_is_a_metric_of_which_more_is_better():
    assert METRICS["manipulability_optimality"].lower_is_better is False


def test_between_samples_a_moving_tip_does_not_take_it_above_one(arm, curve):
    """Where mu* changes along the path, a mu near it is above a mu* interpolated between distant ticks."""
    q = max(curve, key=lambda point: point.mu).q
    trace = _run("task.radius_m=0.05", "task.duration_s=3.0", q=q, controller="gradient")
    rows, best = attainable_manipulability(trace, 3)
    over = trace["manipulability"] / np.interp(np.arange(len(trace)), rows, best)
    assert over.max() > 1.0, "the case is none"
    assert 0.9 < manipulability_optimality(trace) <= 1.0


@pytest.mark.parametrize("seed", range(3))
def test_a_shaft_off_the_trocar_is_not_above_one_either(arm, random_q, seed):
    """With an RCM error the run is held against what it could reach on its own shaft line."""
    rng = np.random.default_rng(seed)
    trace = _held(_run("task.radius_m=0.001"), 4)
    data = trace.data.copy()
    at = {name: i for i, name in enumerate(trace.columns)}
    for row in data:
        q = random_q(rng)
        kin = arm.kinematics(q)
        side = kin.R_WT[:, :2] @ rng.normal(size=2)
        trocar = kin.p_WT - 0.15 * kin.R_WT[:, 2] + 0.01 * side / np.linalg.norm(side)
        row[[at[f"q{i + 1}_rad"] for i in range(7)]] = q
        points = {"tip": kin.p_WT, "wrist": kin.p_WT - 0.4 * kin.R_WT[:, 2], "trocar": trocar}
        for name, point in points.items():
            row[[at[f"{name}_{axis}_m"] for axis in "xyz"]] = point
        row[at["manipulability"]] = np.prod(np.linalg.svd(kin.Jv_WT, compute_uv=False))
    turned = Trace(data, trace.blocks, trace.meta)
    rows, best = attainable_manipulability(turned)
    assert (turned["manipulability"][rows] <= best).all()
    for row, top in zip(rows, best, strict=True):  # the run's own configuration is on its manifold
        tip, here = turned.block("tip")[row], turned.block("q")[row]
        axis = turned.block("wrist")[row] - tip
        axis /= np.linalg.norm(axis)
        centre = tip + ((turned.block("trocar")[row] - tip) @ axis) * axis
        point = SelfMotion(arm, margin_rad=0.0).project(here, tip, centre)
        np.testing.assert_allclose(point.q, here, atol=1e-9)
        assert top >= point.mu * (1.0 - 1e-9)


def test_a_tip_in_the_port_all_along_has_no_optimality():
    trace = _held(_run("task.radius_m=0.001"), 3)
    data = trace.data.copy()
    at = {name: i for i, name in enumerate(trace.columns)}
    for axis in "xyz":
        data[:, at[f"trocar_{axis}_m"]] = data[:, at[f"tip_{axis}_m"]]
    with pytest.raises(Undefined, match="the tip is in the port all along"):
        manipulability_optimality(Trace(data, trace.blocks, trace.meta))
