"""The result in sentences: who wins, by how much, how sure, and where each fails."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from surgsim.compare.failures import failing
from surgsim.compare.leaderboard import leaderboard
from surgsim.compare.observations import Observations
from surgsim.compare.summary import summary
from surgsim.compare.table import read_table

TIP = "tip_error_rms_mm"
RESULTS = Path(__file__).parents[2] / "results" / "leaderboard"


def told(runs, metric=TIP):
    return summary(runs, metric, leaderboard(runs, metric))


def seeds(*values, scenario="s"):
    return {(scenario, seed): value for seed, value in enumerate(values)}


def test_who_wins_by_how_much_and_how_sure(runs_of):
    runs = runs_of({"b": seeds(2.0, 2.1, 2.2, 2.1, 2.0), "a": seeds(1.0, 1.1, 1.0, 1.2, 1.0)}, matters=0.1)
    found = told(runs)
    assert found.winners == ("a",)
    assert found.first.startswith(
        "a wins by tip error, RMS: 1.06 mm on average. Next comes b with 2.08 mm, 1.02 mm worse; "
        "95 % interval 0."
    )
    assert found.first.endswith(" mm, from 5 seeds.")


def test_winners_that_are_not_told_apart_share_the_place(runs_of):
    runs = runs_of({"a": seeds(1.0), "b": seeds(1.01), "c": seeds(3.0), "d": seeds(3.01)}, matters=0.1)
    assert told(runs).first == (
        "a and b share the first place by tip error, RMS: a with 1.00 mm on average. Next comes c (1 more "
        "share its place) with 3.00 mm, 2.00 mm worse (3.0 times as much); how sure is not known: no "
        "interval from 1 seed."
    )


def test_nobody_wins_where_nothing_sets_them_apart(runs_of):
    found = told(runs_of({"a": seeds(1.0), "b": seeds(1.01)}, matters=0.1))
    assert found.winners == ()
    assert found.first == (
        "Nobody wins by tip error, RMS: no controller is told apart. a against b, first and last: too few "
        "pairs (one seed). Seen: −0.0100 mm, less than 0.1 mm."
    )


def test_one_that_alone_has_a_value_is_named(runs_of):
    """The others completed, and the metric is not defined for them: nothing to compare."""
    found = told(runs_of({"a": seeds(None, None), "b": seeds(1.0, 3.0), "c": seeds(None, None)}))
    assert (found.winners, found.first) == ((), "b alone has a value of tip error, RMS: 2.00 mm.")


def test_one_controller_and_none_that_completed(runs_of):
    assert told(runs_of({"a": seeds(1.0)})).first == "a alone was run: tip error, RMS 1.00 mm."
    lost = told(runs_of({"a": seeds("diverged"), "b": seeds("diverged")}))
    assert lost.first == "No run completed with a value of tip error, RMS."


def test_a_controller_that_fails_does_not_win_by_the_runs_that_it_completed(runs_of):
    a, b = seeds(0.1, 0.1, 0.1, 0.1, "diverged", "diverged"), seeds(*[2.0] * 6)
    found = told(runs_of({"a": a, "b": b}))
    assert "a" not in found.winners


def test_what_does_not_matter_is_said_with_its_source(runs_of):
    runs = replace(runs_of({"a": seeds(1.0)}), smallest={})
    assert told(runs).least.startswith(
        "By tip error, RMS, controllers less than 0.1 mm apart count as equal; that is how still surgeons"
    )
    assert told(replace(runs, smallest={TIP: 0.3})).least.endswith(
        "less than 0.3 mm apart count as equal; set for this batch."
    )
    assert told(replace(runs, smallest={TIP: 0.0})).least == ""


def test_where_each_fails(runs_of):
    given = {
        "good": seeds(1.0, 1.0) | seeds(1.0, 1.0, scenario="t"),
        "lost": seeds("rcm_limit", "diverged") | seeds(1.0, "rcm_limit", scenario="t"),
        "idle": seeds(1.0, 1.0) | seeds(1.0, 1.0, scenario="t"),
        "off": seeds(7.0, 1.0) | seeds(1.0, 1.0, scenario="t"),
        "far": seeds(6.0, 9.0) | seeds(1.0, 1.0, scenario="t"),
    }
    runs = runs_of(given, "rcm_error_max_mm")
    success = np.where((runs.controller == "idle") & (runs.scenario == "t"), 0.0, 1.0)
    past = np.where(runs.values("rcm_error_max_mm") > 5.0, "rcm_error_max_mm", "").astype(object)
    found = {one.controllers: one.text for one in failing(replace(runs, success=success, exceeded=past))}
    assert found == {
        ("lost",): "failed in 3 of 4 (2 rcm limit, 1 diverged)",
        ("idle",): "completed, task not done in 2 of 4, in t",
        ("off", "far"): "past thresholds in 1 to 2 of 4 each, in s: RCM error, largest (up to 9.00 mm)",
        ("good",): "nowhere, every run completed and did its task, and no threshold was exceeded",
    }


@pytest.mark.parametrize("suite", ["nominal", "theatre_ideal"])
def test_the_first_sentence_of_the_reference_runs_against_plain_arithmetic(suite):
    """The figures of the sentence, from the rows alone."""
    table = read_table(RESULTS / suite)
    rows, metric = table.rows(), "rcm_error_rms_mm"
    assert all(row["outcome"] == "completed" for row in rows)
    scenarios, names = sorted({r["scenario"] for r in rows}), {r["controller"] for r in rows}
    mean = {
        name: np.mean([
            np.mean([r[metric] for r in rows if (r["scenario"], r["controller"]) == (scenario, name)])
            for scenario in scenarios
        ])
        for name in names
    }  # fmt: skip
    best = min(mean, key=mean.get)
    winners = {name for name in names if mean[name] - mean[best] < 0.1}
    second = min(names - winners, key=mean.get)
    found = told(Observations.of(table), metric)
    assert set(found.winners) == winners
    figures = [f"{value:.3g}" for value in (mean[best], mean[second], mean[second] - mean[best])]
    assert [float(figure) for figure in figures] == pytest.approx(
        [float(text.replace("−", "-")) for text in _figures(found.first)], rel=5e-3
    )
    bad = {name for one in found.failing if one.bad for name in one.controllers}
    assert bad == {r["controller"] for r in rows if r["success"] is False or r["exceeded"]}
    assert {r["controller"] for r in rows if r["rcm_error_max_mm"] > 5.0} <= bad


def _figures(sentence):
    """The winner's mean, the next one's, and the difference."""
    words = sentence.replace(",", "").split()
    return [words[k - 1] for k, word in enumerate(words) if word.rstrip(".;,") == "mm"][:3]
