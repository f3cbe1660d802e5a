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
    MADE_PASSIVE,
    NETWORKS,
    SCHEMES,
    SEEDS,
    SURROUNDINGS,
    Push,
    Render,
    pushes,
    renders,
)
from surgsim.studies.bilateral_schemes.measures import (
    best_table,
    interval,
    map_table,
    rendered_table,
    schemes_table,
    winners_table,
    z_width_table,
)


def row(scheme, mismatch, seed=0, **changes):
    found = {"scheme": scheme, "surroundings": "wall", "grip": "normal", "loss": 0.0, "jitter_ms": 0}
    found |= {"delay_ms": 100, "seed": seed}
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


def test_the_best_presses_like_the_others_and_small_differences_count_for_nothing():
    rows = [
        *seeds("waves", 0.001, 0.001, 0.001, contact_force_n=0.2),
        *seeds("P+d", 0.010, 0.011, 0.012),
        *seeds("two-layer", 0.055, 0.055, 0.055),
        *seeds("set-position", 0.065, 0.065, 0.065),
    ]
    (best,) = winners_table(map_table(rows))
    assert (best["best"], best["qualified"], best["not_told_apart"]) == ("P+d", 4, "two-layer")


def test_a_scheme_is_counted_where_it_is_good_and_where_nobody_is_told_from_it():
    rows = [
        *seeds("P+d", 0.10, 0.11, 0.12),
        *seeds("waves", 0.112, 0.12, 0.13),
        *seeds("waves", 0.2, 0.2, 0.2, delay_ms=300),
        *seeds("P+d", 0.1, 0.1, 0.1, delay_ms=300, rests=0.0, excess_j=0.02, passive=0.0),
        *seeds("P+d", 0.1, 0.1, None, delay_ms=300, jitter_ms=20),
    ]
    table = map_table(rows)
    held, waves = schemes_table(table, winners_table(table))
    assert held == {
        "scheme": "P+d",
        "places": 3,
        "passive": 2,
        "rests": 2,
        "qualified": 1,
        "best": 1,
        "best_or_not_told_apart": 1,
        "excess_max_mj": pytest.approx(20.0),
    }
    assert (waves["places"], waves["best"], waves["best_or_not_told_apart"]) == (2, 1, 2)
    clean, jitter = best_table(winners_table(table))
    assert (clean["100 ms"], clean["300 ms"]) == ("P+d +1", "waves")
    assert (jitter["jitter_ms"], jitter["300 ms"]) == (20, "none")


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
    places = len(SURROUNDINGS) * len(GRIPS) * len(DELAYS_MS) * len(NETWORKS)
    assert len(cells) == len(SCHEMES) * places * len(SEEDS)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_every_scheme_is_one_that_a_scenario_can_name(scheme):
    push = Push(scheme=scheme, surroundings="tissue", grip="light", delay_ms=600, loss=0.2, jitter_ms=20)
    scenario = push.scenario()
    channel = scenario.task.channel
    assert (channel.delay_s, channel.loss, channel.jitter_s) == (0.3, 0.2, 0.02)
    assert scenario.task.bilateral.type in SCHEMES[scheme]
    assert [part.type for part in (*scenario.props, *scenario.disturbances)] == ["tissue"]


def test_quick_through_the_command(tmp_path):
    command = [sys.executable, "-W", "error", "-m", "surgsim", "reproduce", "bilateral_schemes", "--quick"]
    done = subprocess.run([*command, "--json"], cwd=tmp_path, capture_output=True, text=True, timeout=200)
    assert done.returncode == 0, done.stderr
    printed = json.loads(done.stdout)
    found = printed["tables"]["pushes"]
    assert [line["scheme"] for line in found] == ["passive convex, tank", "P+d", "waves"]
    assert all(line["passive"] == 1.0 and line["contact_force_n"] > 0.5 for line in found)
    assert load_study("bilateral_schemes") is STUDY


@pytest.mark.parametrize("scheme", ["position-position", "two-layer"])
def test_the_stiffness_of_a_wall_is_that_of_coupling_and_wall_in_series(scheme):
    """At the handle it is s^2 times that at the tip; both schemes couple by the same spring."""
    render = Render(scheme=scheme, wall=True, delay_ms=0)
    task = render.scenario().task
    coupling, wall = task.bilateral.stiffness_n_per_m, 20000.0
    series = task.mapping.scale**2 * coupling * wall / (coupling + wall)
    assert render.measured().row["stiffness_n_per_m"] == pytest.approx(series, rel=0.01)


def test_a_wall_that_is_not_touched_or_not_held_still_has_no_stiffness():
    for scheme in ("time-domain", "position-force"):
        found = Render(scheme=scheme, wall=True, delay_ms=300).measured().row
        assert found["outcome"] == "completed"
        assert found["stiffness_n_per_m"] is None


def test_the_hand_pushes_as_deep_through_a_delay():
    """It waits until it has seen its own move aside, so that it aims at where the tip is."""
    near, far = (
        Push(scheme="position-position", grip="normal", delay_ms=delay, loss=0.0).run().active()
        for delay in (0, 1000)
    )
    goals = [run.block("hand_intended")[-1] for run in (near, far)]
    scale = near.meta.scenario["task"]["mapping"]["scale"]
    assert scale * np.linalg.norm(goals[0] - goals[1]) < 9e-3  # it was 20 mm and more


def test_free_motion_that_is_not_felt_has_no_impedance():
    """Reflected force of nothing is nothing."""
    found = Render(scheme="position-force", wall=False, delay_ms=300).measured().row
    assert abs(found["impedance_ns_per_m"]) < 1e-3
    assert found["passive"] == 1.0


def test_the_z_width_has_both_ends_and_tells_where_it_is_not_passive():
    def render(wall, stiffness, **changes):
        row = {"scheme": "P+d", "wall": wall, "delay_ms": 0, "passive": 1.0, "stiffness_n_per_m": stiffness}
        return row | {"damping_ns_per_m": 6.0, "impedance_ns_per_m": 7.0} | changes

    good = [render(False, 0.0), render(True, 60.0), render(False, 0.0), render(True, 62.0)]
    (line,) = z_width_table(good)
    assert (line["free_impedance_ns_per_m"], line["wall_stiffness_n_per_m"]) == (7.0, 61.0)
    assert rendered_table([line]) == [{"scheme": "P+d", "0 ms": "7, 61"}]
    (bad,) = rendered_table(z_width_table([*good[:3], render(True, None, passive=0.0)]))
    assert bad["0 ms"] == "7, - !"


RESULTS = Path(__file__).resolve().parents[2] / "results" / "bilateral_schemes"


def test_the_committed_page_is_that_of_the_committed_pushes(read_numbers):
    committed = {
        name: read_numbers(RESULTS / f"{name}.csv")
        for name in ("pushes", "renders", "map", "winners", "schemes")
    }
    assert len(committed["pushes"]) == len(pushes())
    assert len(committed["renders"]) == len(renders())
    page = (RESULTS / "README.md").read_text()
    for claim in STUDY.judge({**committed, "map": map_table(committed["pushes"])}):
        assert f"| {claim.text} | {claim.source} | **{claim.verdict}** |" in page
    again = winners_table(map_table(committed["pushes"]))
    assert [line["best"] for line in again] == [line["best"] for line in committed["winners"]]
    counted = schemes_table(map_table(committed["pushes"]), again)
    assert [line["qualified"] for line in counted] == [line["qualified"] for line in committed["schemes"]]
    assert sorted(path.name for path in RESULTS.glob("*.png")) == [
        "stability.png",
        "transparency.png",
        "z_width.png",
    ]
