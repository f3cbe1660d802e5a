"""The reproduction of the passive convex teleoperation paper: verdicts, parts, committed results."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from surgsim.simulate.loop import simulate
from surgsim.studies import STUDIES, load_study
from surgsim.studies.engine import measure_cases, run_study
from surgsim.studies.passive_teleoperation import STUDY
from surgsim.studies.passive_teleoperation.cases import (
    DELAYS_MS,
    GRIPS,
    LOSSY_DELAYS_MS,
    LOSSY_SEEDS,
    PASSIVITY,
    SHIPPED,
    Push,
    Shipped,
    sweep,
)
from surgsim.studies.passive_teleoperation.measures import frontier_table, steadiness, worst
from surgsim.studies.passive_teleoperation.page import beside_the_paper
from surgsim.studies.timed import Timed

RESULTS = Path(__file__).resolve().parents[2] / "results" / "passive_teleoperation"
TABLES = (
    "paper",
    "scenarios",
    "paper_real",
    "scenarios_real",
    "comparison",
    "frontier",
    "pushes",
    "guarded",
    "timing",
)


@pytest.fixture(scope="module")
def committed(read_numbers):
    return {name: read_numbers(RESULTS / f"{name}.csv") for name in TABLES}


def scenario_row(name, **changes):
    row = {
        "scenario": name,
        "outcome": "completed",
        "duration_s": 40.0,
        "rcm_rms_mm": 0.01,
        "rcm_max_mm": 0.05,
        "velocity_aligned_mm_per_s": 1.0,
        "velocity_unaligned_mm_per_s": 12.0,
        "velocity_all_ticks_mm_per_s": 1.0,
        "tank_min_j": 0.15,
        "deficit_j": 0.0,
        "passivity_percent": 0.0,
        "force_scaled_percent": 0.0,
        "planes_percent": 0.0,
        "plane_contacts": 0,
        "plane_overshoot_mm": None,
        "speed_limit_percent": 0.0,
        "tip_speed_limit_mm_per_s": 250.0,
        "tip_speed_max_mm_per_s": 70.0,
        "slack_max_mm_per_s": 0.001,
        "slack_free_max_mm_per_s": 0.001,
        "rings_transferred": 3.0 if name == "peg and ring" else None,
        "ring_drops": 0.0 if name == "peg and ring" else None,
        "energy_residual_percent": None if name == "peg and ring" else 0.3,
    }
    return row | changes


LIMITS = {
    "planes_percent": 30.0,
    "plane_contacts": 2,
    "plane_overshoot_mm": 0.01,
    "speed_limit_percent": 20.0,
    "tip_speed_limit_mm_per_s": 30.0,
    "tip_speed_max_mm_per_s": 30.1,
    "slack_max_mm_per_s": 40.0,
}


def push_row(passivity, grip, **changes):
    row = {
        "place": "wall",
        "grip": grip,
        "link": "clean",
        "seed": 0,
        "delay_ms": 300,
        "passivity": passivity,
        "end": "rests",
        "delivered_max_j": 0.0,
        "beyond_stock_j": -0.4,
        "contact_deviation_n": 0.1,
        "passivity_percent": 0.0,
        "force_scaled_percent": 0.0,
        "tank_min_j": 0.1 if passivity == "tank" else None,
        "drift_end_mm": 2.0 if passivity == "tdpa" else 0.1,
    }
    return row | changes


def guarded_row(place, guard, deficit):
    row = {"place": place, "guard": guard, "deficit_j": deficit}
    return row | {"acts_percent": 1.5 if guard == "row" else 0.0, "acceleration_ratio": 10.0}


@pytest.fixture
def tables():
    """Tables with which every claim of the paper holds that can."""
    pushes = [
        push_row(p, grip, place=place) for p in PASSIVITY for grip in GRIPS for place in ("wall", "free")
    ]
    for row in pushes:
        if row["passivity"] == "tdpa":
            row.update(end="chatters")
        if row["passivity"] == "off":
            row.update(end="grows", delivered_max_j=2.0)
    return {
        "scenarios": [
            scenario_row(name, **(LIMITS if name == "workspace limits" else {})) for name in SHIPPED
        ],
        "scenarios_real": [scenario_row(name) for name in SHIPPED],
        "pushes": pushes,
        "comparison": pushes,
        "guarded": [
            guarded_row(place, guard, 0.02 if guard == "nothing" else 0.0)
            for place in ("tissue", "throw")
            for guard in ("row", "nothing", "valve")
        ],
        "timing": [{"qp_p50_us": 80.0, "qp_p99_us": 150.0}],
    }


def paper_claims(tables):
    return [claim for claim in STUDY.judge(tables) if claim.source != "surgsim"]


def own_claims(tables):
    return [claim for claim in STUDY.judge(tables) if claim.source == "surgsim"]


def verdicts(claims):
    return [claim.verdict for claim in claims]


def scenario_of(tables, name):
    return next(row for row in tables["scenarios"] if row["scenario"] == name)


def test_every_claim_holds_that_can(tables):
    expected = [*3 * ["holds"], "not comparable", *6 * ["holds"]]
    assert verdicts(paper_claims(tables)) == expected
    assert verdicts(own_claims(tables)) == 7 * ["holds"]


@pytest.mark.parametrize(
    ("scenario", "changes", "index"),
    [
        ("wall, 10 % loss", {"rcm_rms_mm": 0.31}, 0),
        ("peg and ring", {"rcm_max_mm": 1.0}, 1),
        ("free motion", {"velocity_aligned_mm_per_s": 4.8}, 2),
        ("workspace limits", {"plane_overshoot_mm": 0.11}, 4),
        ("workspace limits", {"rcm_max_mm": 0.4}, 4),
        ("workspace limits", {"slack_max_mm_per_s": 0.001}, 4),
        ("workspace limits", {"outcome": "diverged"}, 4),
        ("workspace limits", {"tip_speed_max_mm_per_s": 31.0}, 5),
        ("free motion", {"tank_min_j": 0.0}, 6),
        ("free motion", {"deficit_j": 0.01}, 6),
        ("peg and ring", {"rings_transferred": 2.0}, 7),
        ("peg and ring", {"outcome": "infeasible"}, 7),
    ],
)
def test_a_worse_scenario_turns_its_claim(tables, scenario, changes, index):
    scenario_of(tables, scenario).update(changes)
    assert verdicts(paper_claims(tables))[index] == "does not hold"


def test_an_unaligned_error_below_the_paper_s_is_comparable(tables):
    scenario_of(tables, "free motion").update(velocity_unaligned_mm_per_s=4.0)
    assert verdicts(paper_claims(tables))[3] == "holds"


def test_stability_at_any_delay_turns_with_instability_and_with_energy(tables):
    tank = next(row for row in tables["pushes"] if row["passivity"] == "tank")
    tank.update(end="oscillates", delay_ms=700)
    claim = paper_claims(tables)[8]
    assert claim.verdict == "depends"
    assert "700 ms (oscillates)" in claim.evidence
    tank.update(end="rests", beyond_stock_j=0.01)
    assert paper_claims(tables)[8].verdict == "does not hold"
    for row in tables["pushes"]:
        row.update(end="grows", beyond_stock_j=-0.1)
    assert paper_claims(tables)[8].verdict == "does not hold"


def test_an_empty_tank_in_a_push_turns_the_claim(tables):
    next(row for row in tables["pushes"] if row["passivity"] == "tank").update(tank_min_j=0.0)
    assert verdicts(paper_claims(tables))[6] == "does not hold"


@pytest.mark.parametrize(
    ("changes", "verdict"),
    [
        ({("throw", "row"): 0.03}, "depends"),
        ({("tissue", "nothing"): 0.0}, "depends"),
        ({("throw", "row"): 0.03, ("tissue", "row"): 0.01}, "depends"),
        (
            {(place, "row"): 0.1 for place in ("tissue", "throw")}
            | {(place, "nothing"): 0.0 for place in ("tissue", "throw")},
            "does not hold",
        ),
    ],
)
def test_the_energy_row_is_judged_where_it_acts(tables, changes, verdict):
    for row in tables["guarded"]:
        row["deficit_j"] = changes.get((row["place"], row["guard"]), row["deficit_j"])
    claim = paper_claims(tables)[9]
    assert claim.verdict == verdict
    assert "in 0 of 4" in claim.evidence


def test_our_own_claims_turn(tables):
    for row in tables["pushes"]:
        if row["passivity"] == "off" and row["grip"] == "normal":
            row.update(end="rests", delivered_max_j=0.0)
        if row["passivity"] == "off" and row["grip"] == "light" and row["place"] == "free":
            row.update(end="rests", delivered_max_j=0.0)
        if row["passivity"] == "tdpa":
            row.update(drift_end_mm=0.05, end="rests")
    scenario_of(tables, "free motion").update(energy_residual_percent=1.1)
    tables["timing"][0].update(qp_p99_us=201.0)
    for row in tables["scenarios_real"]:
        row.update(rcm_rms_mm=0.31, velocity_aligned_mm_per_s=4.8)
    assert verdicts(own_claims(tables)) == ["does not hold", "depends", *5 * ["does not hold"]]


@pytest.mark.parametrize(
    "changes", [{"rcm_rms_mm": 0.31}, {"velocity_aligned_mm_per_s": 4.8}, {"outcome": "stuck"}]
)
def test_what_a_scenario_on_real_drives_must_keep(tables, changes):
    tables["scenarios_real"][1].update(changes)
    (claim,) = [claim for claim in own_claims(tables) if "real drives" in claim.text]
    assert claim.verdict == "depends"


def test_claims_without_rows_are_left_out(tables):
    few = {"scenarios": [scenario_row("wall, 10 % loss")], "pushes": [], "comparison": []}
    assert len(paper_claims(few)) == 3
    assert verdicts(own_claims(few)) == ["holds"]


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (("completed", 100.0, 4.9, 8.0, 0.3), "rests"),
        (("completed", 100.0, 4.9, 8.0, 0.6), "chatters"),
        (("completed", 1.0, 1.0, 0.0, 0.0), "rests"),
        (("completed", 100.0, 79.0, 8.0, 5.0), "decays"),
        (("completed", 100.0, 90.0, 8.0, 5.0), "oscillates"),
        (("completed", 100.0, 106.0, 8.0, 5.0), "grows"),
        (("completed", 0.0, 50.0, 8.0, 5.0), "grows"),
        (("completed", 800.0, 150.0, 0.0, 0.0), "runs away"),
        (("completed", 800.0, 149.0, 0.0, 0.0), "decays"),
        (("velocity_limit", 0.0, 0.0, 0.0, 0.0), "stopped"),
    ],
)
def test_steadiness(found, expected):
    assert steadiness(*found) == expected


def test_the_frontier_takes_the_worst_seed_and_the_smallest_unstable_delay():
    ends = [(0, "rests"), (300, "rests"), (300, "oscillates"), (500, "grows"), (500, "stopped")]
    rows = [push_row("off", "light", delay_ms=delay, end=end) for delay, end in ends]
    rows.append(push_row("tank", "light", delay_ms=300, end="decays"))
    off, tank = frontier_table(rows)
    assert (off["0_ms"], off["300_ms"], off["500_ms"]) == ("rests", "oscillates", "stopped")
    assert off["unstable_from_ms"] == 300
    assert (tank["0_ms"], tank["300_ms"], tank["unstable_from_ms"]) == (None, "decays", None)
    assert worst([]) is None


def test_the_paper_s_figures_stand_beside_ours(tables):
    rows = beside_the_paper(tables["scenarios"])
    assert rows[0] == {"figure": "RCM error, RMS (mm)", "paper": 0.3} | dict.fromkeys(SHIPPED, 0.01)


def test_the_sweep_has_every_cell_once():
    cells = sweep()
    assert len(set(cells)) == len(cells)
    seeds = len(PASSIVITY) * (len(LOSSY_SEEDS) - 1)
    delays = len(GRIPS) * len(DELAYS_MS) + sum(len(lossy) for lossy in LOSSY_DELAYS_MS.values())
    assert len(cells) == len(PASSIVITY) * delays + seeds


def test_a_push_is_what_it_says():
    push = Push(place="wall", passivity="tdpa", grip="light", delay_ms=700, link="lossy", seed=3)
    scenario = push.scenario()
    task = scenario.task
    assert (scenario.seed, task.bilateral.passivity, len(scenario.props)) == (3, "tdpa", 1)
    assert (task.operator.expected_delay_s, task.operator.stiffness_n_per_m) == (0.7, 20.0)
    assert (task.channel.delay_s, task.channel.jitter_s, task.channel.loss) == (0.35, 0.01, 0.1)
    assert Push(place="free", passivity="off", grip="normal", delay_ms=0).scenario().props == ()


def test_two_processes_give_the_same_rows_as_one():
    cases = [
        Push(place=place, passivity="tank", grip="light", delay_ms=100, cut_s=0.3)
        for place in ("wall", "free")
    ]
    one, two = (measure_cases(cases, lambda line: None, workers) for workers in (1, 2))
    assert [one[case].row for case in cases] == [two[case].row for case in cases]
    assert list(two) == cases


def test_timing_the_qp_does_not_change_the_motion():
    shipped = Shipped(name="free motion", keys=("task.duration_s=0.3",))
    plain, watched = simulate(shipped.scenario()), Timed(shipped).run()
    np.testing.assert_array_equal(plain.block("v"), watched.block("v"))
    assert np.all(watched["qp_time_s"] > 0.0)
    assert np.all(watched["qp_time_s"] < watched["control_time_s"])


def test_quick_through_the_command(tmp_path):
    command = [sys.executable, "-W", "error", "-m", "surgsim", "reproduce", "passive_teleoperation"]
    done = subprocess.run(
        [*command, "--quick", "--json"], cwd=tmp_path, capture_output=True, text=True, timeout=200
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr.startswith("1 of 4: free motion\n")
    printed = json.loads(done.stdout)
    folder = tmp_path / "results" / "passive_teleoperation_quick"
    assert sorted(path.name for path in folder.iterdir()) == sorted(printed["files"])
    assert "    surgsim reproduce passive_teleoperation --quick\n" in (folder / "README.md").read_text()
    ends = {row["passivity"]: row["end"] for row in printed["tables"]["pushes"]}
    assert ends["off"] == "runs away"
    assert ends["tank"] == "rests"
    limits = printed["tables"]["scenarios"][1]
    assert limits["planes_percent"] > 0.0
    assert limits["speed_limit_percent"] > 0.0


def test_the_command_knows_the_study():
    assert load_study("passive_teleoperation") is STUDY
    assert "passive_teleoperation" in STUDIES


def test_a_push_made_again_gives_the_committed_row(committed):
    row = Push(place="wall", passivity="tank", grip="normal", delay_ms=300).measured().row
    wanted = {key: row[key] for key in ("place", "grip", "link", "delay_ms", "passivity")}
    (stored,) = [other for other in committed["pushes"] if wanted.items() <= other.items()]
    assert list(row) == list(stored)
    for name, value in row.items():
        same = value == stored[name] if isinstance(value, str | None) else None
        assert same or value == pytest.approx(stored[name], rel=1e-3, abs=1e-6), name


def test_the_committed_page_shows_every_claim(committed):
    claims = STUDY.judge(committed)
    assert len(claims) == 17
    page = (RESULTS / "README.md").read_text()
    assert "    surgsim reproduce passive_teleoperation\n" in page
    for claim in claims:
        assert f"| {claim.text} | {claim.source} | **{claim.verdict}** |" in page
        assert claim.evidence
    pictures = sorted(RESULTS.glob("*.png"))
    assert len(pictures) == 5
    for picture in pictures:
        assert f"]({picture.name})" in page
        assert picture.stat().st_size < 500_000


def test_the_committed_sweep_is_whole(committed):
    wall = [row for row in committed["pushes"] if row["place"] == "wall"]
    assert len(wall) == len(sweep())
    assert frontier_table(committed["pushes"]) == committed["frontier"]


def test_a_scenario_on_real_drives_made_again_gives_the_committed_row(committed):
    row = Shipped("wall, 10 % loss", real=True).measured().row
    (stored,) = [other for other in committed["scenarios_real"] if other["scenario"] == row["scenario"]]
    for name, value in row.items():
        assert value == stored[name] or value == pytest.approx(stored[name], rel=1e-3, abs=1e-6), name


def test_on_real_drives_a_scenario_keeps_its_workspace():
    ideal, real = (Shipped("workspace limits", real=real).scenario() for real in (False, True))
    assert real.robot.drive is not None
    assert real.controller.resolver.planes == ideal.controller.resolver.planes
    assert real.controller.resolver.tip_speed_max_m_per_s == 0.03
    assert real.controller.torque_law.type == "rcm_elastic_dynamics"


@pytest.mark.slow
def test_everything_made_again_gives_the_same_ends(tmp_path, committed, read_numbers):
    run_study(STUDY, tmp_path, False, lambda line: None)
    again = read_numbers(tmp_path / "frontier.csv")
    assert again == committed["frontier"]
