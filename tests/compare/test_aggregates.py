"""Scores, interquartile means, profiles and ranks: worked by hand, and against rliable."""

import numpy as np
import pytest
from scipy.stats import trim_mean

from surgsim.compare.aggregates import (
    interquartile_mean,
    iqm_interval,
    performance_profile,
    ranks,
    scores,
)
from surgsim.compare.columns import Table
from surgsim.compare.intervals import SEEDS_DO_NOT_MATTER
from surgsim.compare.leaderboard import leaderboard
from surgsim.compare.table import read_table, schema
from surgsim.errors import SurgsimError

TIP = "tip_error_rms_mm"
GRID = np.arange(30).reshape(10, 3)
A, B = (GRID * 7 % 31) / 10, (GRID * 11 % 37) / 10


def tasks(block):
    """Runs of three scenarios and ten seeds from a block (10, 3)."""
    return {(f"s{j}", i): float(block[i, j]) for i in range(10) for j in range(3)}


def test_interquartile_mean_equals_rliable_and_scipy():
    assert interquartile_mean(np.array([A.ravel(), B.ravel()])) == pytest.approx(
        [1.45, 1.7625]
    )  # rliable 1.2.0
    for size in range(1, 12):
        x = np.random.default_rng(size).random(size)
        padded = np.append(x, [np.nan] * 3)
        assert interquartile_mean(padded[None])[0] == pytest.approx(trim_mean(x, 0.25))
    assert np.isnan(interquartile_mean(np.array([[np.nan]]))[0])


def test_performance_profile_equals_rliable(runs_of):
    runs = runs_of({"a": tasks(A)})
    found = performance_profile(runs, runs.values(TIP), np.array([0.0, 1.0, 2.0, 3.0]))
    above = 1 - found.fraction  # rliable's score is better when larger: the share above tau
    assert above == pytest.approx([0.96666667, 0.63333333, 0.3, 0.0])
    assert (found.low <= found.fraction).all()
    assert (found.fraction <= found.high).all()
    assert (found.high - found.low).max() > 0.1


def test_failures_never_count_in_a_profile(runs_of):
    runs = runs_of({"a": {("s", 0): 1.0, ("s", 1): 2.0, ("s", 2): "diverged", ("s", 3): "rcm_limit"}})
    found = performance_profile(runs, scores(runs, TIP), np.array([0.1, 1.0, 1e9]))
    assert found.fraction.tolist() == [0.0, 0.25, 0.5]


def test_scores_are_ratios_to_the_best_controllers_median(runs_of):
    runs = runs_of({"a": tasks(np.full((10, 3), 2.0)), "b": tasks(np.full((10, 3), 6.0))})
    assert scores(runs, TIP).tolist() == [1.0] * 30 + [3.0] * 30
    name = "manipulability_mean"  # more is better
    better = runs_of({"a": {("s", 0): 2.0}, "b": {("s", 0): 6.0}, "c": {("s", 0): "diverged"}}, name)
    assert scores(better, name) == pytest.approx([3.0, 1.0, np.nan], nan_ok=True)


def test_scores_of_a_metric_with_negative_values_count_in_interquartile_ranges(runs_of):
    given = {"a": {("s", i): x for i, x in enumerate((-1.0, -2.0, -3.0))}, "b": {("s", 0): -6.0}}
    spread = np.subtract(*np.percentile([-1, -2, -3, -6], [75, 25]))
    expected = [1 + (-2 - x) / spread for x in (-1, -2, -3, -6)]
    assert scores(runs_of(given, "sparc"), "sparc") == pytest.approx(expected)
    same = runs_of({"a": {("s", 0): 0.0}, "b": {("s", 0): 0.0}}, "saturated_fraction")
    assert scores(same, "saturated_fraction").tolist() == [1.0, 1.0]


def test_ranks_share_ties_and_put_failures_last(runs_of):
    def one(value):
        return {("s", 0): value}

    runs = runs_of({"a": one(1.0), "b": one(1.0), "c": one("diverged"), "d": one(5.0), "e": one("rcm_limit")})
    assert ranks(runs, TIP).tolist() == [1.5, 1.5, 4.5, 3.0, 4.5]


def test_ranks_are_not_taken_where_a_controller_is_missing(runs_of):
    runs = runs_of({"a": {("s", 0): 1.0, ("s", 1): 1.0}, "b": {("s", 0): 2.0}})
    assert ranks(runs, TIP) == pytest.approx([1.0, np.nan, 2.0], nan_ok=True)


def test_leaderboard_counts_failures_beside_every_figure(runs_of):
    runs = runs_of(
        {
            "late": {("s", i): 5.0 + i for i in range(8)},
            "first": {("s", i): 1.0 + 0.1 * i for i in range(8)},
            "fails": {("s", i): "diverged" if i < 5 else 0.5 for i in range(8)},
            "never": {("s", i): "rcm_limit" for i in range(8)},
        }
    )
    rows = {row.controller: row for row in leaderboard(runs, TIP)}
    assert list(rows) == ["first", "late", "fails", "never"]
    fails = rows["fails"]
    assert (fails.runs, fails.completed, fails.failed, fails.failures) == (8, 3, 5, {"diverged": 5})
    assert (fails.value.value, fails.value.note) == (0.5, "only 3 seeds: no interval")
    assert rows["never"].value.value is None
    assert rows["first"].value.value == pytest.approx(1.35)
    assert rows["first"].value.low < 1.35 < rows["first"].value.high
    assert rows["first"].rank.value == pytest.approx((5 * 1 + 3 * 2) / 8)


def test_leaderboard_counts_the_runs_that_did_not_do_their_task(rows_of_table):
    given = [True, True, False, None]
    table = rows_of_table([{"seed": i, "success": done, TIP: 1.0} for i, done in enumerate(given)])
    (row,) = leaderboard(table, TIP)
    assert (row.completed, row.failed, row.not_done) == (4, 0, 1)


def test_a_leaderboard_without_chance_says_so(runs_of):
    runs = runs_of({"a": {("s", i): 1.0 for i in range(8)}})
    (row,) = leaderboard(runs, TIP)
    assert (row.value.value, row.value.low, row.value.note) == (1.0, None, SEEDS_DO_NOT_MATTER)


def test_leaderboard_of_a_table_is_the_same_each_time(made_results):
    table = read_table(made_results())
    first, again = leaderboard(table, TIP), leaderboard(Table.of_rows(table.rows()[::-1], schema()), TIP)
    assert {row.controller: row for row in first} == {row.controller: row for row in again}
    assert sum(row.runs for row in first) == 360
    assert all(row.runs == row.completed + row.failed == 90 for row in first)
    assert first[0].controller == "rcm_inverse_dynamics"
    assert first[0].rank.value == 1.0


def test_leaderboard_refuses_what_is_no_table_or_metric(made_results):
    with pytest.raises(SurgsimError, match="'speed' is not a metric"):
        leaderboard(read_table(made_results()), "speed")
    with pytest.raises(SurgsimError, match="not a table of batch results"):
        leaderboard(Table({"seed": (1,)}), TIP)
    table = read_table(made_results())
    worded = Table({**table.columns, TIP: ("x",) * len(table)})
    with pytest.raises(SurgsimError, match="not a table of batch results"):
        leaderboard(worded, TIP)


@pytest.mark.parametrize(("strata", "seeds"), [(1, 10), (3, 5), (3, 10)])
def test_95_percent_intervals_of_the_interquartile_mean_cover_it(runs_of, strata, seeds):
    rng = np.random.default_rng(2)
    truth = float(interquartile_mean(rng.exponential(1.0, 2_000_000)[None])[0])
    covered = 0
    for _ in range(300):
        given = {(f"s{k}", i): float(rng.exponential(1.0)) for k in range(strata) for i in range(seeds)}
        runs = runs_of({"a": given})
        found = iqm_interval(runs, runs.values(TIP), "x", 300)
        covered += found.low <= truth <= found.high
    assert 0.90 <= covered / 300 <= 0.99
