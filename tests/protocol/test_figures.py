"""Numbers of a scorecard against formulas of their own; failures are never averaged away."""

import math

import numpy as np
import pytest
from scipy import stats

from surgsim.protocol.definition import load_protocol
from surgsim.protocol.figures import figures_of, quantile_interval, share
from surgsim.protocol.levels import axis_results, reason_of
from surgsim.protocol.rows import UNREACHABLE, Row
from surgsim.protocol.scorecard import failures

CONFIG = load_protocol().config


def row(axis="base", level=None, seed=0, outcome="completed", success=True, exceeded=(), **metrics):
    """A row of the generator `theatre` on a Panda."""
    point = "base" if level is None else f"{axis}={level:g}"
    return Row(
        cell=f"theatre/panda/{point}/{seed}",
        generator="theatre",
        arm="panda",
        axis=axis,
        level=level,
        seed=seed,
        scenario_sha256="0" * 64,
        run_key="0" * 64,
        outcome=outcome,
        success=success,
        exceeded=tuple(exceeded),
        metrics={**dict.fromkeys(CONFIG.metrics), **metrics},
    )


@pytest.mark.parametrize("n", [72, 100, 400])
def test_the_interval_is_between_order_statistics_of_binomial_ranks(n):
    values = np.arange(1.0, n + 1.0)
    found = quantile_interval(np.random.default_rng(n).permutation(values), 0.95)
    low, high = int(found.low), int(found.high)
    assert found.value == math.ceil(0.95 * n - 1e-9)
    covered = sum(math.comb(n, k) * 0.95**k * 0.05 ** (n - k) for k in range(low, high))
    assert 0.95 <= covered < 0.995
    for narrower in ((low + 1, high), (low, high - 1)):
        tail = stats.binom.cdf(narrower[0] - 1, n, 0.95), stats.binom.sf(narrower[1] - 1, n, 0.95)
        assert max(tail) > 0.025


def test_the_interval_covers_the_truth_as_often_as_it_says():
    rng, truth = np.random.default_rng(1), math.exp(stats.norm.ppf(0.95))
    hits = 0
    for _ in range(2000):
        found = quantile_interval(rng.lognormal(size=80), 0.95)
        hits += found.low <= truth <= found.high
    assert 0.945 <= hits / 2000 <= 0.985


def test_too_few_runs_leave_the_interval_open_above():
    found = quantile_interval(np.arange(71.0), 0.95)
    assert found.high is None
    assert found.note == "open above: 71 runs"
    assert quantile_interval(np.arange(72.0), 0.95).high == 71.0


def test_a_failure_is_worse_than_any_value():
    values = np.array([1.0] * 95 + [math.inf] * 5)
    assert quantile_interval(values, 0.95).value == 1.0
    assert quantile_interval(values, 0.95).high is None
    found = quantile_interval(np.array([1.0] * 94 + [math.inf] * 6), 0.95)
    assert (found.value, found.note) == (None, "6 of 100 runs failed")


def test_figures_are_of_runs_with_no_axis_changed():
    rows = [row(seed=i, tip_error_max_mm=float(i)) for i in range(100)]
    rows += [row("breathing", 10.0, tip_error_max_mm=1e6, outcome="diverged")]
    rows += [row(seed=200, outcome=UNREACHABLE, success=False)]
    found = figures_of(rows, [], CONFIG)
    assert found["tip_p95"].value == 94.0
    assert found["completed"].value == 1.0
    assert found["completed"].n == 100
    assert found["port_force_p95"].value is None


def test_done_asks_for_the_task_and_all_thresholds():
    rows = [row(seed=0), row(seed=1, success=False), row(seed=2, exceeded=["rcm_error_max_mm"])]
    rows += [row(seed=3, outcome="diverged", success=False), row(seed=4, success=None)]
    found = figures_of(rows, [], CONFIG)
    assert found["completed"].value == 4 / 5
    assert found["done"].value == 2 / 5
    assert failures(rows) == {"diverged": 1, "not done": 1, "past thresholds": 1}
    assert [reason_of(each) for each in rows if each.failed] == ["not done", "past thresholds", "diverged"]


def test_a_share_has_the_wilson_interval():
    found = share([True] * 8 + [False] * 2)
    expected = stats.binomtest(8, 10).proportion_ci(method="wilson")
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high))


def test_the_first_failing_level_is_the_first_with_any_failure():
    levels = CONFIG.generators["theatre"].axes["breathing"].levels
    rows = [row(seed=i) for i in range(3)]
    rows += [row("breathing", level, seed=i) for level in levels for i in range(2)]
    rows[5] = row("breathing", levels[1], seed=0, success=False)
    breathing, noise = axis_results(rows, CONFIG, ["theatre"])
    assert breathing.first_failing == 2
    assert breathing.levels[2].why == {"not done": 1}
    assert (breathing.levels[2].runs, breathing.held) == (2, 1)
    assert (noise.first_failing, noise.held) == (None, len(noise.levels) - 1)
    held = figures_of(rows, [breathing, noise], CONFIG)["levels_held"]
    assert held.value == (1 + 4) / (3 + 4)


def test_who_fails_unchanged_holds_no_level():
    rows = [row(outcome="velocity_limit", success=False), row("breathing", 10.0)]
    found = axis_results(rows, CONFIG, ["theatre"])
    assert [(axis.first_failing, axis.held) for axis in found] == [(0, 0), (0, 0)]
