"""The comparison of bilateral schemes: intervals, who is best, claims, and the command."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from surgsim.studies import load_study
from surgsim.studies.bilateral_schemes import STUDY
from surgsim.studies.bilateral_schemes.cases import (
    DELAYS_MS,
    GRIPS,
    LOSSES,
    MADE_PASSIVE,
    SCHEMES,
    SEEDS,
    Push,
    pushes,
)
from surgsim.studies.bilateral_schemes.measures import interval, map_table, winners_table


def row(scheme, mismatch, seed=0, **changes):
    found = {"scheme": scheme, "grip": "normal", "loss": 0.0, "delay_ms": 100, "seed": seed}
    found |= {"passive": 1.0, "rests": 1.0, "excess_j": -0.1, "contact_force_n": 3.0, "drift_mm": 1.0}
    return found | {"mismatch": mismatch} | changes


def seeds(scheme, *mismatches, **changes):
    return [row(scheme, mismatch, seed, **changes) for seed, mismatch in enumerate(mismatches)]


def test_an_interval_is_that_of_a_t_test():
    values = [0.1, 0.14, 0.09, 0.12]
    mean, low, high = interval(values)
    exact = stats.ttest_1samp(values, 0.0).confidence_interval(0.95)
    assert (mean, low, high) == pytest.approx((np.mean(values), exact.low, exact.high))
    assert interval([0.3])[0] == 0.3
    assert not np.isfinite(interval([0.3])[1:]).any()


def test_the_best_is_the_most_transparent_of_those_that_are_passive_and_rest_with_every_seed():
    rows = [
        *seeds("P+d", 0.10, 0.11, 0.12),
        *seeds("waves", 0.112, 0.12, 0.13),
        *seeds("two-layer", 0.5, 0.51, 0.52),
        *seeds("position-position", 0.01, 0.01, 0.01)[:2],
        row("position-position", 0.01, 2, passive=0.0, excess_j=0.02),
        *seeds("time-domain", 0.02, 0.02, None),
        *seeds("four-channel", 0.01, 0.01, 0.01, rests=0.0),
    ]
    (best,) = winners_table(map_table(rows))
    assert (best["best"], best["qualified"], best["not_told_apart"]) == ("P+d", 3, "waves")
    assert best["mismatch"] == pytest.approx(0.11)
    (none,) = winners_table(map_table(rows[-3:]))
    assert (none["best"], none["qualified"], none["mismatch"]) == ("none", 0, None)


def tables(**excess):
    rows = [line for name in SCHEMES for line in seeds(name, 0.1, 0.1, 0.1)]
    for line in rows:
        line["excess_j"] = excess.get(line["scheme"], -0.1)
        line["passive"] = float(line["excess_j"] <= 1e-3)
    return {"pushes": rows, "map": map_table(rows)}


def verdicts(found):
    return [claim.verdict for claim in STUDY.judge(found)]


def test_claims_turn_with_what_was_measured():
    assert verdicts(tables()) == ["holds", "holds", "does not hold", "holds"]
    assert verdicts(tables(**{"passive convex, tank": 0.01}))[0] == "does not hold"
    assert verdicts(tables(waves=0.01))[1] == "depends"
    assert verdicts(tables(**dict.fromkeys(MADE_PASSIVE, 0.01)))[1] == "does not hold"
    bare = {name: 0.5 for name in SCHEMES if name not in MADE_PASSIVE}
    assert verdicts(tables(**bare))[2] == "holds"
    assert verdicts(tables(**dict.fromkeys(SCHEMES, 0.5)))[3] == "does not hold"


def test_the_map_has_every_place_once():
    cells = pushes()
    assert len(set(cells)) == len(cells)
    assert len(cells) == len(SCHEMES) * len(GRIPS) * len(DELAYS_MS) * len(LOSSES) * len(SEEDS)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_every_scheme_is_one_that_a_scenario_can_name(scheme):
    task = Push(scheme=scheme, grip="light", delay_ms=600, loss=0.2, seed=2).scenario().task
    assert (task.channel.delay_s, task.channel.loss) == (0.3, 0.2)
    assert task.bilateral.type in SCHEMES[scheme]


def test_quick_through_the_command(tmp_path):
    command = [sys.executable, "-W", "error", "-m", "surgsim", "reproduce", "bilateral_schemes", "--quick"]
    done = subprocess.run([*command, "--json"], cwd=tmp_path, capture_output=True, text=True, timeout=200)
    assert done.returncode == 0, done.stderr
    printed = json.loads(done.stdout)
    found = printed["tables"]["pushes"]
    assert [line["scheme"] for line in found] == ["passive convex, tank", "P+d", "waves"]
    assert all(line["passive"] == 1.0 and line["contact_force_n"] > 0.5 for line in found)
    assert load_study("bilateral_schemes") is STUDY


RESULTS = Path(__file__).resolve().parents[2] / "results" / "bilateral_schemes"


def test_the_committed_page_is_that_of_the_committed_pushes(read_numbers):
    committed = {name: read_numbers(RESULTS / f"{name}.csv") for name in ("pushes", "map", "winners")}
    assert len(committed["pushes"]) == len(pushes())
    page = (RESULTS / "README.md").read_text()
    for claim in STUDY.judge({**committed, "map": map_table(committed["pushes"])}):
        assert f"| {claim.text} | {claim.source} | **{claim.verdict}** |" in page
    again = winners_table(map_table(committed["pushes"]))
    assert [line["best"] for line in again] == [line["best"] for line in committed["winners"]]
    assert sorted(path.name for path in RESULTS.glob("*.png")) == ["stability.png", "transparency.png"]
