"""The reproduction of the manipulability paper: committed results, re-made samples, and the parts."""

from pathlib import Path

import numpy as np
import pytest

from surgsim.metrics.accuracy import rms
from surgsim.models.arm import ArmModel
from surgsim.models.config import RobotConfig, SceneConfig
from surgsim.studies import manipulability_validation as study
from surgsim.studies.engine import run_study
from surgsim.studies.manipulability_validation import STUDY, calibrate, cases, within_limits
from surgsim.studies.manipulability_validation.calibrate import HOMES, HOMES_RAD, PAPER, PATHS, STEPS
from surgsim.studies.manipulability_validation.cases import PERIOD_S, Cell, UnfittedHome, stepped
from surgsim.studies.samples import by, judge_ratios, judge_together, sample_row
from surgsim.studies.stepped import acceleration_ratio, tip_errors

RESULTS = Path(__file__).resolve().parents[2] / "results" / "manipulability_validation"
CELLS = [(path, home) for path in PATHS for home in HOMES]


@pytest.fixture(scope="module")
def committed(read_numbers):
    names = tuple(sorted(path.stem for path in RESULTS.glob("*.csv")))
    return {name: read_numbers(RESULTS / f"{name}.csv") for name in names}


@pytest.fixture(scope="module")
def remade(tmp_path_factory, read_numbers):
    """Tables of two cells, made now."""
    out = tmp_path_factory.mktemp("quick")
    run_study(STUDY, out, True, lambda line: None)
    return {path.stem: read_numbers(path) for path in out.glob("*.csv")}


def by_cell(rows):
    return {(row["path"], int(row["home"])): row for row in rows}


def assert_same(row, stored, tolerance):
    """Equal texts, and numbers equal up to a relative tolerance."""
    assert list(row) == list(stored)
    for name, value in row.items():
        if isinstance(value, float):
            assert value == pytest.approx(stored[name], rel=tolerance, abs=1e-9), (name, row)
        else:
            assert value == stored[name]


@pytest.mark.parametrize(
    ("table", "tolerance"),
    [("table_4", 1e-7), ("table_4_increase", 1e-6), ("table_5", 1e-6), ("attainable", 1e-4)],
)
def test_a_sample_made_again_gives_the_committed_figures(remade, committed, table, tolerance):
    stored = by_cell(committed[table])
    assert [(row["path"], row["home"]) for row in remade[table]] == list(study.QUICK_SAMPLE)
    for row in remade[table]:
        assert_same(row, stored[row["path"], row["home"]], tolerance)


def test_every_average_of_table_4_is_within_one_percent_of_the_paper(committed):
    rows = by_cell(committed["table_4"])
    assert list(rows) == CELLS
    for (path, home), row in rows.items():
        assert row["pinv"] == pytest.approx(PAPER["pinv"][path][home - 1], rel=0.01)
        assert row["rnn"] == pytest.approx(PAPER["rnn"][path][home - 1], rel=0.01)


def test_every_increase_is_positive(committed):
    rows = committed["table_4_increase"]
    assert len(rows) == 12
    assert min(row["increase"] for row in rows) > 0.0


def test_self_motion_reaches_nine_tenths_of_the_attainable_gain_inside_the_limits(committed):
    rows = by_cell(committed["attainable"])
    assert list(rows) == CELLS
    for row in rows.values():
        assert 0.9 <= row["fraction_self_motion"] <= 1.0
        assert row["tip_rms_m"] <= 1e-5
        assert within_limits(row)
        assert row["self_motion"] <= row["attainable"]


def test_matched_errors_are_the_drift_and_lagged_ones_about_a_step(committed):
    for row in committed["table_5"]:
        if row["home"] != 1:  # whose drift is as large as a step
            assert row["pinv_matched"] < 0.45 * row["step_length"]
            assert row["pinv_lagged"] == pytest.approx(row["step_length"], rel=0.1)
        assert row["rnn_matched"] > row["pinv_matched"]


def test_the_network_as_printed_diverges_where_the_table_says(committed):
    rows = committed["printed_network"]
    assert [row["outcome"] for row in rows] == 5 * ["diverged"] + ["completed"]
    for case, row in zip(cases.PRINTED_NETWORKS[:3], rows, strict=False):
        trace = case.run()
        assert trace.meta.ending.outcome.name == "DIVERGED"
        assert round(trace.meta.ending.t_s / PERIOD_S) == row["last_step"]


def test_the_paper_s_increases_are_the_differences_of_its_averages():
    for path in PATHS:
        base, optimised = (np.array(PAPER[name][path]) for name in ("pinv", "rnn"))
        np.testing.assert_allclose(optimised - base, PAPER["increase"][path], atol=1.01e-4)
        percent = 100.0 * (optimised / base - 1.0)
        np.testing.assert_allclose(percent, PAPER["percent"][path], atol=0.45)


def test_the_runs_agree_with_the_independent_model_of_the_calibration(committed):
    found, margin = calibrate.averages(np.array([HOMES_RAD[home][:6] for home in HOMES]), STEPS)
    rows = by_cell(committed["table_4"])
    for column, path in enumerate(PATHS):
        for home in HOMES:
            assert rows[path, home]["pinv"] == pytest.approx(found[home - 1, column], rel=1e-5)
            steady = found[home - 1, 3 + column]
            assert rows[path, home]["rnn"] == pytest.approx(steady, rel=5e-3)
    assert margin.min() > calibrate.MARGIN_RAD
    given_up = [row["margin_rad"] for row in committed["homes"] if "given up" in str(row["home"])]
    assert len(given_up) == 2
    assert max(given_up) < 0.0


def test_the_calibration_s_kinematics_are_the_arm_s():
    arm = ArmModel(SceneConfig(robot=RobotConfig(name="lwr4plus"), instrument=None))
    q = np.random.default_rng(3).uniform(-2.0, 2.0, (5, 6))
    jacobians, axes = calibrate.kinematics(q)
    for k in range(5):
        kin = arm.kinematics(np.append(q[k], 0.0))
        np.testing.assert_allclose(jacobians[k].T, kin.Jv_WT, atol=1e-12)
        np.testing.assert_allclose(axes[k], kin.z_W, atol=1e-12)


def test_refinement_finds_a_home_again():
    home = 3
    target = calibrate.table_4_averages(home)
    start = np.array([HOMES_RAD[home][:6]]) + 0.02
    (q,) = calibrate.refine(start, target, 60, 6)
    before, after = (np.abs(calibrate.averages(x, 60)[0] / target - 1.0).max() for x in (start, q[None]))
    assert after < 1e-3 < before


@pytest.mark.parametrize("path", PATHS)
def test_the_velocity_of_a_step_leads_from_sample_to_sample(path):
    task = Cell(path=path, home=2, method="pinv").setup().task
    commands = [task.command(k * PERIOD_S) for k in range(STEPS + 1)]
    points = np.array([command.p_WTd for command in commands])
    steps = PERIOD_S * np.array([command.v_WTd for command in commands])
    np.testing.assert_allclose(points[1:] - points[:-1], steps[:-1], atol=1e-15)
    lengths = np.linalg.norm(steps[:-1], axis=1)
    if path != "sinusoid":
        assert lengths == pytest.approx(lengths.mean(), rel=1e-4)
    assert np.abs(steps[-1]).max() == 0.0


def test_a_random_home_made_again_gives_the_committed_row_and_the_independent_model_s(committed, remade):
    for row in remade["random_homes_every"]:
        assert_same(row, committed["random_homes_every"][int(row["home"])], 1e-5)
    followed = [row for row in remade["random_homes_every"] if row["followed"] == "yes"]
    assert 0 < len(followed) < len(remade["random_homes_every"])
    q = np.array([UnfittedHome(int(row["home"])).draw() for row in followed])
    found, _ = calibrate.averages(q, STEPS)
    for row, averages in zip(followed, found, strict=True):
        percent = 100.0 * (averages[3:] / averages[:3] - 1.0)
        assert [row[f"{path}_percent"] for path in PATHS] == pytest.approx(percent, rel=0.05)


def test_the_random_homes_are_two_hundred_and_are_counted(committed):
    every = [row for row in committed["random_homes_every"] if row["followed"] == "yes"][:200]
    for row in committed["random_homes"]:
        wanted = [row["path"]] if row["path"] in PATHS else PATHS
        found = [min(one[f"{path}_percent"] for path in wanted) for one in every]
        assert (row["n"], row["drawn"]) == (200, 1 + every[-1]["home"])
        assert row["increases"] == sum(x > 0.0 for x in found)
        assert row["median_percent"] == pytest.approx(np.median(found), rel=1e-6)
    assert not set(HOMES_RAD.values()) & {UnfittedHome(k).draw() for k in range(10)}


def test_a_sample_s_intervals_cover_as_often_as_they_say():
    """Medians of the standard normal distribution, whose median is 0."""
    rng, covered = np.random.default_rng(730127), 0
    for _ in range(400):
        row = sample_row(rng.standard_normal(60))
        covered += row["median_low_percent"] <= 0.0 <= row["median_high_percent"]
    assert 0.93 <= covered / 400 <= 0.99
    assert sample_row([1.0, 2.0, 3.0])["share_low_percent"] is None


def test_in_the_same_time_the_increase_does_not_depend_on_the_number_of_steps(committed):
    medians = by(committed["steps"], "kept", "median_percent")
    assert max(medians["time of the path"]) < 1.02 * min(medians["time of the path"])
    assert medians["time of a step"][-1] > 5.0 * medians["time of a step"][0]
    case = stepped("circle", 4, "rnn", 500, same_time=True)
    assert (case.period_s, case.duration_s) == (0.02, 10.0)
    assert stepped("circle", 4, "rnn", 500, same_time=False).period_s == PERIOD_S
    assert stepped("circle", 4, "rnn", 1000, same_time=True) == Cell("circle", 4, "rnn")


def test_ratios_and_ranks_are_judged():
    assert judge_ratios({"a": [1.0, 1.2], "b": [2.0, 2.1]}, 1.1, "%")[0] == "depends"
    assert judge_ratios({"a": [1.0]}, 1.1, "%") is None
    up, down = list(range(5)), list(range(5, 0, -1))
    assert judge_together({"one": (up, up)})[0] == "holds"
    assert judge_together({"one": (up, down), "two": (up, up)})[0] == "depends"
    assert judge_together({"one": (up[:4], up[:4])}) is None


def test_errors_with_matched_and_lagged_indices(trace_of):
    tip = np.column_stack([np.arange(5.0), np.zeros(5), np.zeros(5)])
    trace = trace_of(5, tip=tip, tip_ref=tip + np.array([0.0, 2.0, 0.0]))
    matched, lagged = tip_errors(trace)
    np.testing.assert_allclose(matched, 2.0)
    np.testing.assert_allclose(lagged, np.hypot(1.0, 2.0))
    assert rms(matched) == pytest.approx(2.0)


def test_the_acceleration_from_rest_counts(trace_of):
    v = np.zeros((3, 7))
    v[1:, 2] = 0.008
    trace = trace_of(3, v=v)
    limit = trace.meta.limits["acceleration"][2]
    assert acceleration_ratio(trace) == pytest.approx(8.0 / limit)


def test_a_worse_result_changes_the_verdicts(committed):
    verdicts = {claim.text: claim.verdict for claim in STUDY.judge(committed)}
    assert sum(verdict == "holds" for verdict in verdicts.values()) == 6
    assert sum(verdict == "can be fitted" for verdict in verdicts.values()) == 3
    spoilt = {name: [dict(row) for row in rows] for name, rows in committed.items()}
    spoilt["table_4"][0]["pinv_off_percent"] = 1.2
    spoilt["table_4_increase"][5]["increase"] = -1e-5
    spoilt["random_homes"][1]["share_percent"] = 98.5
    spoilt["attainable"][7]["fraction_self_motion"] = 0.89
    spoilt["attainable"][2]["acceleration_over_limit"] = 1.01
    for row in spoilt["attainable"]:
        row["tip_rms_m"] = 2e-5
    changed = [claim for claim in STUDY.judge(spoilt) if claim.verdict != verdicts[claim.text]]
    assert sorted(claim.verdict for claim in changed) == [*5 * ["depends"], "does not hold"]
    assert "11 of 12 cells" in changed[0].evidence


def test_the_scenarios_are_the_paper_s_setting():
    found = Cell(path="circle", home=4, method="rnn").scenario()
    assert (found.instrument, found.trocar, found.plant.type) == (None, None, "kinematic")
    assert found.task.duration_s / found.simulation.control_period_s == pytest.approx(STEPS)
    assert found.controller.resolver.k_tip == 0.0
    literal = Cell(path="circle", home=4, method="pinv", dh_variant="literal").scenario()
    assert literal.robot.dh_variant == "literal"


def test_the_committed_folder_is_whole_and_small():
    page = (RESULTS / "README.md").read_text()
    assert "    surgsim reproduce manipulability_validation\n" in page
    pictures = sorted(RESULTS.glob("*.png"))
    assert len(pictures) == 7
    for picture in pictures:
        assert f"]({picture.name})" in page
        assert picture.stat().st_size < 300_000


@pytest.mark.slow
def test_everything_made_again_gives_the_committed_tables(tmp_path, committed, read_numbers):
    result = run_study(STUDY, tmp_path, False, lambda line: None)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(result.files)
    assert {path.name for path in RESULTS.iterdir()} == set(result.files)
    for name, rows in committed.items():
        again = read_numbers(tmp_path / f"{name}.csv")
        for row, stored in zip(again, rows, strict=True):
            assert_same(row, stored, 1e-4)
