"""The smallest difference that matters: in verdicts, ranks, scores and places."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binomtest

from surgsim.compare.aggregates import ranks, scores
from surgsim.compare.leaderboard import leaderboard
from surgsim.compare.matters import checked_matters, parse_matters
from surgsim.compare.ranking import places_of
from surgsim.compare.statistics import chance_of_failures, compare_pair
from surgsim.compare.suite import SuiteConfig, with_changes
from surgsim.compare.summary import summary
from surgsim.compare.verdict import Verdict
from surgsim.errors import SurgsimError
from surgsim.metrics.catalog import METRICS

TIP = "tip_error_rms_mm"
NOISE = np.array([0.0, 0.01, -0.01, 0.02, -0.02, 0.005])


def line(values, scenario="s"):
    return {(scenario, seed): float(value) for seed, value in enumerate(values)}


def one(value):
    return {("s", 0): value}


@pytest.mark.parametrize(
    ("shift", "spread", "verdict", "sentence"),
    [
        (-7e-4, 0.001, Verdict.EQUIVALENT, "Equivalent: −6.99e−4 [−7"),
        (0.5, 1.0, Verdict.WORSE, "a is worse than b by 0.501 mm (+50 %) [0.4"),
        (-0.5, 1.0, Verdict.BETTER, "a is better than b by 0.499 mm (−50 %) [0.4"),
        (0.1, 1.0, Verdict.PERHAPS, "a is worse than b by 0.101 mm (+10 %) [0.08"),
        (0.0, 20.0, Verdict.NOT_TOLD_APART, "Not told apart, nor equivalent within ±0.1 mm: 0.0167 [−"),
    ],
)
def test_the_verdict_asks_whether_a_difference_matters(runs_of, shift, spread, verdict, sentence):
    runs = runs_of({"a": line(1.0 + shift + spread * NOISE), "b": line(np.ones(6))}, matters=0.1)
    found = compare_pair(runs, "a", "b", TIP)
    assert found.verdict is verdict
    assert found.sentence.startswith(sentence)
    if verdict is Verdict.PERHAPS:
        assert found.sentence.endswith("; whether by 0.1 mm, the least that matters, is open.")
    if verdict is Verdict.EQUIVALENT:
        assert found.sentence.endswith(" mm, inside ±0.1 mm.")


def test_a_mean_that_does_not_matter_names_the_scenarios_in_which_it_does(runs_of):
    up, down = line(1.3 + NOISE, "s"), line(0.7 + NOISE, "t")
    given = {"a": up | down, "b": line(np.ones(6), "s") | line(np.ones(6), "t")}
    found = compare_pair(runs_of(given, matters=0.1), "a", "b", TIP)
    assert found.verdict is Verdict.EQUIVALENT
    assert found.sentence.endswith("inside ±0.1 mm, but not in 2 of 2 scenarios.")


def test_one_seed_says_what_was_seen_and_no_interval(runs_of):
    runs = runs_of({"a": one(1.0), "b": one(1.05), "c": one(4.0)}, matters=0.1)
    near, far = (compare_pair(runs, "a", name, TIP) for name in "bc")
    assert near.sentence == "Too few pairs (one seed). Seen: −0.0500 mm, less than 0.1 mm."
    assert far.sentence == "Too few pairs (one seed). Seen: a better than c by 3.00 mm."
    assert (near.improvement.value, far.improvement.value) == (0.5, 1.0)
    assert far.improvement.low is None


def test_seeds_and_pairs_are_counted_apart(runs_of):
    given = {name: {(f"s{k}", 0): value + k for k in range(6)} for name, value in (("a", 1.0), ("b", 3.0))}
    found = compare_pair(runs_of(given), "a", "b", TIP)
    assert (found.pairs, found.seeds) == (6, (1,) * 6)
    assert (found.improvement.low, found.improvement.note) == (None, "one seed: no interval")


def test_differences_that_do_not_matter_are_ties_in_ranks(runs_of):
    runs = runs_of({"a": one(1.0), "b": one(1.05), "c": one(1.12), "d": one(3.0)}, matters=0.1)
    assert ranks(runs, TIP).tolist() == [1.5, 2.0, 2.5, 4.0]  # a-b and b-c tie, a-c does not
    assert ranks(replace(runs, smallest={TIP: 0.0}), TIP).tolist() == [1.0, 2.0, 3.0, 4.0]
    assert ranks(replace(runs, smallest={TIP: 10.0}), TIP).tolist() == [2.5] * 4


def test_scores_do_not_multiply_what_does_not_matter(runs_of):
    given = {"a": one(1e-5), "b": one(1e-3), "c": one(2.0)}
    assert scores(runs_of(given, matters=0.1), TIP) == pytest.approx([1.0, 1.0, 20.0])
    assert scores(runs_of(given), TIP) == pytest.approx([1.0, 100.0, 2e5])


def test_a_task_that_was_not_done_comes_after_those_that_were_and_before_failures(runs_of):
    runs = runs_of({"a": one(1.0), "b": one(0.1), "c": one("diverged"), "d": one(9.0)})
    runs = replace(runs, success=np.array([1.0, 0.0, np.nan, np.nan]))
    assert ranks(runs, TIP).tolist() == [1.0, 3.0, 4.0, 2.0]
    found = compare_pair(runs, "a", "b", TIP)
    assert found.improvement.value == 1.0
    assert found.sentence.endswith(" Completed, task not done: a 0, b 1 of 1 pairs.")
    assert {row.controller: row.not_done for row in leaderboard(runs, TIP)} == {
        "a": 0,
        "b": 1,
        "c": 0,
        "d": 0,
    }


def test_who_is_not_told_apart_shares_a_place(runs_of):
    given = {
        "near": line(1.0 + NOISE),
        "like": line(1.02 - NOISE),
        "far": line(2.0 + NOISE),
        "fails": {("s", seed): "diverged" for seed in range(6)},
    }
    assert places_of(runs_of(given, matters=0.1), TIP) == {"near": 1, "like": 1, "far": 3, "fails": 4}
    rows = leaderboard(runs_of(given, matters=0.1), TIP)
    assert [row.place for row in rows] == [1, 1, 3, 4]
    assert [row.place for row in leaderboard(runs_of(given), TIP, places=False)] == [None] * 4


def test_who_fails_more_comes_after_whatever_its_figures(runs_of):
    given = {
        "accurate": line([0.1] * 18) | {("s", 18): "diverged", ("s", 19): "diverged"},
        "steady": line(5.0 + 0.1 * np.arange(20)),
        "once": line(np.full(19, 0.2)) | {("s", 19): "rcm_limit"},
    }
    runs = runs_of(given, matters=0.1)
    assert places_of(runs, TIP) == {"steady": 1, "once": 2, "accurate": 3}
    assert [row.controller for row in leaderboard(runs, TIP)] == ["steady", "once", "accurate"]
    found = compare_pair(runs, "accurate", "steady", TIP)
    assert found.verdict is Verdict.BETTER  # of the runs that it completed
    assert chance_of_failures(found) == 0.5  # two pairs in which one alone failed: (1 + 1)/4
    told = summary(runs, TIP, leaderboard(runs, TIP)).first
    assert told.endswith(" once fails more often: 1 of its paired runs against 0 (p = 1.0 by chance alone).")


@pytest.mark.parametrize("alone", [(0, 0), (0, 1), (1, 1), (0, 5), (2, 7), (9, 4), (30, 31)])
def test_the_chance_of_failures_is_that_of_the_exact_binomial_test(runs_of, alone):
    found = compare_pair(runs_of({"a": line([0.1] * 3), "b": line([0.2] * 3)}, matters=0.1), "a", "b", TIP)
    found = replace(found, left_out={"a failed": alone[0], "b failed": alone[1]})
    wanted = binomtest(alone[0], sum(alone), 0.5).pvalue if sum(alone) else 1.0
    assert chance_of_failures(found) == pytest.approx(wanted, abs=1e-12)


def test_who_misses_the_task_more_often_comes_after(runs_of):
    runs = runs_of({"near": line(np.full(6, 0.1)), "far": line(5.0 + NOISE)}, matters=0.1)
    runs = replace(runs, success=np.array([1.0] * 5 + [0.0] + [1.0] * 6))
    assert places_of(runs, TIP) == {"far": 1, "near": 2}
    told = summary(runs, TIP, leaderboard(runs, TIP)).first
    assert told.endswith(" near misses its task more often: in 1 paired runs against 0.")


def test_one_seed_gives_places_by_what_was_seen(runs_of):
    assert places_of(runs_of({"a": one(1.0), "b": one(1.05), "c": one(4.0)}, matters=0.1), TIP) == {
        "a": 1, "b": 1, "c": 3
    }  # fmt: skip


@pytest.mark.parametrize("metric", METRICS.values(), ids=lambda metric: metric.name)
def test_every_metric_says_what_matters_and_is_headed_by_words(metric):
    words, _, unit = metric.heading.partition(" [")
    assert "_" not in metric.heading
    assert words != metric.name
    units = {"mm_per_s": "mm/s", "n_s": "N s", "_mm": "mm", "_n": "N", "_j": "J", "_rad": "rad", "_us": "µs"}
    wanted = next((told for suffix, told in units.items() if metric.name.endswith(suffix)), None)
    assert wanted is None or unit == f"{wanted}]"
    assert metric.matters >= 0.0
    source = metric.matters_source
    assert source.text
    assert (metric.matters == 0.0) == (source.kind == "none")
    assert bool(source.reference) == (source.kind in ("clinical", "instrument"))


def test_the_command_line_says_what_matters():
    assert parse_matters(["rcm_error_rms_mm=0.5", "sparc=0"]) == {"rcm_error_rms_mm": 0.5, "sparc": 0.0}
    for text in ("rcm_error_rms_mm", "rcm_error_rms_mm=much", "rcm_error_rms_mm=-1", "rcm_error_rms_mm=nan"):
        with pytest.raises(SurgsimError) as caught:
            parse_matters([text])
        assert str(caught.value) == f"--matters: '{text}' is not METRIC=VALUE with a value of 0 or more"
    with pytest.raises(SurgsimError, match="'rcm_error' is not a metric"):
        parse_matters(["rcm_error=1"])


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (-1, "-1"),
        (-1e-9, "-1e-09"),
        (math.nan, "nan"),
        (math.inf, "inf"),
        ("0.5", "0.5"),
        ("much", "much"),
        (None, "None"),
        (True, "True"),
    ],
)
def test_what_is_no_number_of_zero_or_more_does_not_matter(value, said):
    suite = SuiteConfig(name="s", scenarios=("circle_lwr4plus",))
    text = f"--matters: 'sparc={said}' is not METRIC=VALUE with a value of 0 or more"
    for judge in (checked_matters, lambda given: with_changes(suite, None, None, False, matters=given)):
        with pytest.raises(SurgsimError) as caught:
            judge({"sparc": value})
        assert str(caught.value) == text


def test_numbers_of_numpy_matter_too():
    found = checked_matters({"sparc": np.float64(0.5), "rcm_error_rms_mm": np.int64(2)})
    assert found == {"sparc": 0.5, "rcm_error_rms_mm": 2.0}
    assert {type(value) for value in found.values()} == {float}
    with pytest.raises(SurgsimError, match=r"^--matters: a str is no mapping of metrics to numbers$"):
        checked_matters("sparc=1")


def test_a_suite_says_what_matters():
    told = {"rcm_error_rms_mm": 0.5}
    suite = SuiteConfig(name="s", scenarios=("circle_lwr4plus",), matters=told)
    assert with_changes(suite, None, None, False, matters={"sparc": 1.0}).matters == {**told, "sparc": 1.0}
    with pytest.raises(ValueError, match="'speed' is not a metric"):
        SuiteConfig(name="s", scenarios=("circle_lwr4plus",), matters={"speed": 1.0})
    with pytest.raises(ValueError, match="greater than or equal to 0"):
        SuiteConfig(name="s", scenarios=("circle_lwr4plus",), matters={"sparc": -1.0})
