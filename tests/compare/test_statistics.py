"""Paired comparisons: cases worked by hand, failures, ties, coverage, determinism."""

import numpy as np
import pytest

from surgsim.compare.intervals import (
    ONE_SEED,
    SEEDS_DO_NOT_MATTER,
    mean_interval,
    percentile,
    proportion_interval,
)
from surgsim.compare.statistics import compare_all, compare_pair
from surgsim.compare.verdict import Verdict
from surgsim.errors import SurgsimError

TIP = "tip_error_rms_mm"


def line(*values, scenario="s"):
    return {(scenario, seed): value for seed, value in enumerate(values)}


def test_effect_is_the_mean_of_differences_within_seeds(runs_of):
    runs = runs_of({"a": line(1.0, 2.0, 3.0, 4.0, 5.0), "b": line(2.0, 2.5, 4.0, 6.0, 5.5)})
    found = compare_pair(runs, "a", "b", TIP)
    assert found.difference.value == pytest.approx((-1 - 0.5 - 1 - 2 - 0.5) / 5)
    assert found.difference.low < -1 < found.difference.high < 0
    assert (found.pairs, found.difference.n, found.verdict) == (5, 5, Verdict.BETTER)
    assert (found.mean_a, found.mean_b) == (3.0, 4.0)
    assert found.sentence.startswith("a is better than b by 1.00 mm (−25 %) [0.")


def test_swapping_the_controllers_mirrors_everything(runs_of):
    runs = runs_of({"a": line(1.0, 2.0, 3.0, 4.0, 5.0), "b": line(2.0, 2.5, 4.0, 6.0, 5.5)})
    ab, ba = compare_pair(runs, "a", "b", TIP), compare_pair(runs, "b", "a", TIP)
    assert ba.difference.value == -ab.difference.value
    assert ba.verdict is Verdict.WORSE
    assert ba.improvement.value == 1 - ab.improvement.value


def test_direction_comes_from_the_metric(runs_of):
    given = {"a": line(0.2, 0.3, 0.25, 0.21, 0.28), "b": line(0.1, 0.12, 0.13, 0.12, 0.11)}
    assert compare_pair(runs_of(given), "a", "b", TIP).verdict is Verdict.WORSE
    name = "manipulability_mean"
    assert compare_pair(runs_of(given, name), "a", "b", name).verdict is Verdict.BETTER


def test_no_difference_detected_is_said_in_words(runs_of):
    runs = runs_of({"a": line(1.0, 2.0, 3.0, 4.0, 5.0), "b": line(2.0, 1.0, 3.5, 3.5, 5.0)})
    found = compare_pair(runs, "a", "b", TIP)
    assert found.verdict is Verdict.NOT_TOLD_APART
    assert found.sentence.startswith("Not told apart: 0 [−")
    assert found.improvement.value == pytest.approx(0.5)  # two wins, two losses and a tie


def test_failures_are_left_out_of_the_effect_counted_and_lose(runs_of):
    a = line(1.0, "rcm_limit", 1.2, "diverged", 1.1, 1.0, 0.9, 1.3)
    b = line(2.0, 2.1, 2.2, "diverged", 2.3, 2.4, "diverged", 2.2)
    found = compare_pair(runs_of({"a": a, "b": b}), "a", "b", TIP)
    assert found.left_out == {"a failed": 1, "both failed": 1, "b failed": 1}
    assert (found.pairs, found.failed_a, found.failed_b) == (5, 2, 2)
    assert found.difference.value == pytest.approx(np.mean([-1, -1, -1.2, -1.4, -0.9]))
    assert found.improvement.value == pytest.approx((5 + 0 + 0.5 + 1) / 8)
    assert found.sentence.endswith("Failed: a 2, b 2 of 8 pairs.")


def test_missing_pairs_and_undefined_values_are_named(runs_of):
    a, b = line(1.0, 2.0, None, 4.0, 5.0, 6.0, 7.0), line(2.0, 2.5, 4.0, 6.0, 5.5, 7.0)
    found = compare_pair(runs_of({"a": a, "b": b}), "a", "b", TIP)
    assert found.left_out == {"metric not defined": 1, "run of b missing": 1}
    assert (found.pairs, found.improvement.n) == (5, 5)


@pytest.mark.parametrize(
    ("a", "b", "sentence"),
    [
        (line(1.0, 2.0), line(2.0, 2.5), "Too few pairs (only 2 seeds). Seen: a better than b by 0.750 mm."),
        (line(1.0), line(2.0), "Too few pairs (one seed). Seen: a better than b by 1.00 mm."),
        (line("diverged"), line(2.0), "Too few pairs: none (1 a failed). Failed: a 1, b 0 of 1 pairs."),
        ({}, line(2.0), "Too few pairs: none (1 run of a missing)."),
    ],
)
def test_too_few_pairs_give_no_interval_but_words(runs_of, a, b, sentence):
    found = compare_pair(runs_of({"a": a, "b": b}), "a", "b", TIP)
    assert (found.verdict, found.sentence) == (Verdict.TOO_FEW, sentence)
    assert found.difference.low is None


def test_a_scenario_without_chance_gets_no_interval(runs_of):
    runs = runs_of({"a": line(*[0.1 + 0.2] * 10), "b": line(*[1.3] * 10), "c": line(*[0.3] * 10)})
    found = compare_pair(runs, "a", "b", TIP)
    assert (found.difference.note, found.difference.low) == (SEEDS_DO_NOT_MATTER, None)
    assert (found.improvement.note, found.improvement.value) == (SEEDS_DO_NOT_MATTER, 1.0)
    assert found.sentence == "a is better than b by 1.00 mm (−77 %), seeds do not matter."
    assert compare_pair(runs, "a", "c", TIP).verdict is Verdict.EQUAL  # but for rounding


def test_grid_points_of_one_seed_count_once(runs_of):
    from dataclasses import replace

    single = runs_of({"a": line(1.0, 2.0, 3.0, 4.0, 5.0), "b": line(2.0, 2.5, 4.0, 6.0, 5.5)})
    index = np.tile(np.arange(len(single)), 4)
    points = np.repeat([f'{{"x": {i}}}' for i in range(4)], len(single)).astype(object)
    whole = replace(single.where(index), parameters=points)
    found, once = compare_pair(whole, "a", "b", TIP), compare_pair(single, "a", "b", TIP)
    assert (found.pairs, found.difference.n) == (20, 5)
    assert found.difference == once.difference


def test_scenarios_weigh_the_same(runs_of):
    a = line(*[1.0] * 6) | line(1.0, 1.1, scenario="t")
    b = line(*[2.0] * 6) | line(5.0, 5.1, scenario="t")
    runs = runs_of({"a": a, "b": b})
    assert compare_pair(runs, "a", "b", TIP).difference.value == pytest.approx(-2.5)
    assert compare_pair(runs, "a", "b", TIP, scenario="t").difference.value == pytest.approx(-4.0)


def test_the_same_data_in_any_order_give_the_same_interval(runs_of):
    rng = np.random.default_rng(0)
    runs = runs_of({"a": line(*rng.random(12)), "b": line(*rng.random(12))})
    shuffled = runs.where(rng.permutation(len(runs)))
    first, again = (compare_pair(some, "a", "b", TIP) for some in (runs, shuffled))
    assert first == again
    other = runs_of({"a": line(*rng.random(12)), "b": line(*rng.random(12))})
    assert compare_pair(other, "a", "b", TIP).difference != first.difference


def test_every_couple_is_compared_once(runs_of):
    runs = runs_of({name: line(1.0, 2.0) for name in "abcd"})
    assert [f"{c.a}{c.b}" for c in compare_all(runs, TIP)] == ["ab", "ac", "ad", "bc", "bd", "cd"]


def test_an_unknown_metric_is_refused(runs_of):
    with pytest.raises(SurgsimError, match="'tip_error_rms' is not a metric"):
        compare_pair(runs_of({"a": line(1.0)}), "a", "a", "tip_error_rms")


DRAWS = {
    "normal": lambda rng, n: rng.normal(0.0, 1.0, n),
    "skewed": lambda rng, n: rng.lognormal(0.0, 1.0, n) - np.exp(0.5),
}


@pytest.mark.parametrize("kind", DRAWS)
@pytest.mark.parametrize(("strata", "seeds"), [(1, 10), (1, 20), (3, 10)])
def test_95_percent_intervals_of_the_mean_cover_the_truth_about_that_often(kind, strata, seeds):
    rng = np.random.default_rng(11)
    covered = 0
    for _ in range(300):
        found = mean_interval([(1 + k) * DRAWS[kind](rng, seeds) for k in range(strata)])
        covered += found.low <= 0.0 <= found.high
    assert 0.90 <= covered / 300 <= 0.99


def test_a_plain_percentile_interval_would_fail_the_test_above():
    rng = np.random.default_rng(11)
    covered = 0
    for _ in range(300):
        x = DRAWS["skewed"](rng, 10)
        low, high = np.quantile(x[rng.integers(0, 10, (1000, 10))].mean(axis=1), [0.025, 0.975])
        covered += low <= 0.0 <= high
    assert covered / 300 < 0.86


def test_paired_comparison_covers_a_known_effect_and_seldom_invents_one(runs_of):
    rng = np.random.default_rng(5)
    covered = invented = 0
    for _ in range(300):
        common = rng.lognormal(0.0, 1.0, 10)  # far more spread between seeds than between controllers
        noise = 0.1 * rng.standard_normal((3, 10))
        runs = runs_of({name: line(*(common + noise[i] + 5)) for i, name in enumerate("ab")} | {
            "c": line(*(common + noise[2] + 5.3))
        })  # fmt: skip
        effect = compare_pair(runs, "a", "c", TIP)
        covered += effect.difference.low <= -0.3 <= effect.difference.high
        invented += compare_pair(runs, "a", "b", TIP).verdict is not Verdict.NOT_TOLD_APART
    assert 0.90 <= covered / 300 <= 0.99
    assert 0.01 <= invented / 300 <= 0.10


def test_mostly_tied_values_fall_back_to_the_percentile_interval():
    found = mean_interval([np.array([0.0] * 9 + [1.0])])
    assert found.low == 0.0 < found.value < found.high <= 1.0


def test_expanded_percentile_matches_student_t_for_normal_resamples():
    figures = np.random.default_rng(0).standard_normal(200_000) * np.sqrt(9 / 10)  # resampled means, s = 1
    low, high = percentile(figures, [10])
    assert [low, high] == pytest.approx([-2.262, 2.262], abs=0.05)


def test_wilson_interval_against_scipy():
    from scipy.stats import binomtest

    for wins, n in ((0, 10), (7, 10), (10, 10)):
        expected = binomtest(wins, n).proportion_ci(method="wilson")
        found = proportion_interval(wins / n, [n])
        assert (found.low, found.high) == pytest.approx((expected.low, expected.high))
    assert proportion_interval(1.0, [1]).note == ONE_SEED
