"""What the commands, the Python front and the files say of a run of several arms."""

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

import surgsim
from surgsim.api.reading import _summary
from surgsim.cli.main import main
from surgsim.compare.job import REFUSED, Job, do
from surgsim.compare.table import Row, read_rows
from surgsim.export.overlay import figures
from surgsim.metrics.catalog import METRICS, evaluate, of_one_arm
from surgsim.recording.blueprint import blueprint
from surgsim.recording.read import read_recording
from surgsim.recording.replay import Replay
from surgsim.recording.scene import rebuild_all, scenario_of
from surgsim.recording.side_by_side import _blueprint
from surgsim.report import scene_process
from surgsim.report.series import read_series
from surgsim.scenario.load import load_experiment
from surgsim.verdict import judge

NAME = "two_ports_panda"
SHORT = {"duration_s": 0.3, "ramp_s": 0.15, "hold_start_s": 0.0, "hold_end_s": 0.0, "radius_m": 0.002}
SETTINGS = {f"arms.{k}.task.{key}": value for k in (0, 1) for key, value in SHORT.items()}
WORDS = [word for key, value in SETTINGS.items() for word in ("--set", f"{key}={value}")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A short run, recorded."""
    path = tmp_path_factory.mktemp("several") / "run"
    assert main(["run", NAME, "--out", str(path), *WORDS]) == 0
    return path


@pytest.fixture(scope="module")
def trace(folder):
    return read_recording(folder).trace


@pytest.fixture
def told(capsys):
    """Runs a command: its status, and what it printed."""

    def run(*words):
        capsys.readouterr()
        status = main([str(word) for word in words])
        return status, capsys.readouterr().out

    return run


def test_columns_and_metrics_begin_with_the_arms_name(folder, trace):
    assert trace.columns[0] == "t_s"
    assert all(column.startswith(("left_", "right_")) for column in trace.columns[1:])
    summary = json.loads((folder / "metrics.json").read_text())
    assert set(summary["metrics"]) == {f"{arm}_{name}" for arm in ("left", "right") for name in METRICS}
    for arm in ("left", "right"):
        own = evaluate(trace.of(arm)).values
        assert of_one_arm(summary["metrics"], arm) == own
        verdict = judge(trace.of(arm), own)
        assert summary["arms"][arm] == {"controller": "rcm_inverse_dynamics", **verdict.to_dict()}
    assert summary["success"] is True
    assert summary["controller"] == "rcm_inverse_dynamics"


def test_all_have_done_their_task_only_if_each_has(trace):
    metrics = dict(evaluate(trace).values)
    assert judge(trace, metrics).success is True
    metrics["right_tip_error_max_mm"] = 99.0
    verdict = judge(trace, metrics)
    assert verdict.success is False
    assert [held.metric for held in verdict.exceeded] == ["right_tip_error_max_mm"]
    assert verdict.reason.startswith("left: the path was followed, right: tip_error_max_mm 99 exceeds 3")


def test_inspect_has_a_column_for_each_arm(folder, told):
    status, printed = told("inspect", folder)
    assert status == 0
    assert printed.splitlines()[1].split() == ["metric", "left", "right", "meaning"]
    assert "left: Done: " in printed
    assert "right: Done: " in printed
    assert "metrics computed again from the recording equal those stored in it" in printed


@pytest.fixture(scope="module")
def moved(tmp_path_factory) -> Path:
    """The same run with the right arm's path 1 mm to the side."""
    path = tmp_path_factory.mktemp("several") / "moved"
    assert main(["run", NAME, "--out", str(path), *WORDS, "--set", "arms.1.task.start_m.0=0.051"]) == 0
    return path


def test_two_runs_of_the_same_arms_are_compared_arm_by_arm(folder, moved, told):
    status, printed = told("inspect", folder, moved)
    assert status == 0
    lines = printed.splitlines()
    assert next(line.split() for line in lines if "start_m" in line)[0] == "arms.1.task.start_m"
    assert [line for line in lines if line.startswith("Metrics of ")] == [
        "Metrics of left",
        "Metrics of right",
    ]
    (left, right) = [float(line.split()[-2]) for line in lines if line.startswith("largest distance between")]
    assert left < 0.01
    assert right == pytest.approx(1.0, abs=0.01)
    told_json = json.loads(told("inspect", folder, moved, "--json")[1])
    assert set(told_json["b_minus_a"]) == {f"{arm}_{name}" for arm in ("left", "right") for name in METRICS}
    assert told_json["b_minus_a"]["left_tip_error_rms_mm"] == pytest.approx(0.0, abs=1e-6)


def test_two_runs_of_the_same_arms_are_shown_side_by_side(folder, moved, told, tmp_path):
    file = tmp_path / "pair.rrd"
    assert told("inspect", folder, moved, "--out", file)[0] == 0
    held = {chunk.entity_path for chunk in RrdReader(file).stream()}
    alone = {chunk.entity_path for chunk in RrdReader(folder / "recording.rrd").stream()}
    alone = {path for path in alone if not path.startswith(("/surgsim", "/__"))}
    for side in "ab":
        assert {path for path in held if path.startswith(f"/{side}/")} == {f"/{side}{path}" for path in alone}
    shown = [
        content.removeprefix("+ ").removesuffix("/**")
        for view in _views(_blueprint([read_recording(run).trace for run in (folder, moved)]).root_container)
        for content in ([view.contents] if isinstance(view.contents, str) else view.contents)
        if content.startswith("+ /")
    ]
    assert {f"/{side}/{arm}/errors_mm" for side in "ab" for arm in ("left", "right")} <= set(shown)
    assert [path for path in shown if not any(entity.startswith(path) for entity in held)] == []


def test_runs_of_other_arms_are_not_set_side_by_side(folder, tmp_path, capsys):
    alone = tmp_path / "alone"
    short = [word for key, value in SHORT.items() for word in ("--set", f"task.{key}={value}")]
    assert main(["run", "circle_panda", "--out", str(alone), *short]) == 0
    assert main(["inspect", str(folder), str(alone)]) == 2
    told = " ".join(capsys.readouterr().err.split())
    assert f"{folder} is a run of arms left and right, {alone} of one arm: two runs side by side have" in told


def test_the_recording_has_both_arms_ports_paths_and_signals(folder):
    paths = {chunk.entity_path for chunk in RrdReader(folder / "recording.rrd").stream()}
    for arm in ("left", "right"):
        bodies = {f"/scene/{arm}/{part}" for part in ("link7", "port", "tip", "desired_path", "actual_path")}
        assert {path for path in bodies if not any(p.startswith(path) for p in paths)} == set()
        assert {f"/{arm}/signals/{block}" for block in ("q", "tau", "tip_error")} <= paths
        assert f"/{arm}/errors_mm" in paths
    assert "/signals/q" not in paths
    assert any(path.startswith("/scene/patient") for path in paths)


def _views(part):
    """Every view of a layout."""
    if isinstance(part, rrb.View):
        return [part]
    return [view for child in part.contents or () for view in _views(child)]


def test_the_layout_has_plots_of_each_arm_and_shows_what_is_there(folder, trace):
    held = {chunk.entity_path for chunk in RrdReader(folder / "recording.rrd").stream()}
    shown = [
        content.removeprefix("+ ").removesuffix("/**")
        for view in _views(blueprint(scenario_of(trace), trace).root_container)
        for content in ([view.contents] if isinstance(view.contents, str) else view.contents)
        if content.startswith("+ /")
    ]
    for arm in ("left", "right"):
        assert f"/{arm}/errors_mm" in shown
        assert f"/{arm}/signals/tau" in shown
    assert [path for path in shown if not any(entity.startswith(path) for entity in held)] == []


def test_the_replayed_tips_are_where_the_trace_has_them(trace):
    scenes = rebuild_all(scenario_of(trace))
    replay = Replay(scenes, trace)
    for row in (0, len(trace) - 1):
        replay.place(row)
        for scene, one in zip(scenes, trace.each(), strict=True):
            np.testing.assert_allclose(
                replay.data.site_xpos[scene.tip_site], one.block("tip")[row], rtol=0.0, atol=1e-12
            )


def test_python_has_a_run_for_each_arm(folder):
    run = surgsim.read(folder)
    assert list(run.arms) == ["left", "right"]
    left = run.arms["left"]
    assert (left.outcome, left.success, left.controller) == ("completed", True, "rcm_inverse_dynamics")
    assert left.metrics["tip_error_rms_mm"] == run.metrics["left_tip_error_rms_mm"]
    assert left.trace.equals(run.trace.of("left"))
    assert left.scenario.robot.base_position_m == (0.0, 0.0, 0.0)
    assert dict(left.arms) == {}
    with pytest.raises(surgsim.SurgsimError, match=r"several arms: ask for arms\['left'\].scenario"):
        _ = run.scenario
    with pytest.raises(surgsim.SurgsimError, match=r"ask for arms\['left'\].figure"):
        run.figure()
    with pytest.raises(surgsim.SurgsimError, match="a scenario of one arm is needed here"):
        surgsim.load(NAME)
    assert _summary(run.trace, run.metrics)["arms"].keys() == run.arms.keys()


@pytest.fixture(scope="module")
def batch(tmp_path_factory):
    out = tmp_path_factory.mktemp("batch") / "out"
    changes = {**SETTINGS, "theatre": False}
    return surgsim.compare([NAME], seeds=[0], settings=changes, out=out, record=True, jobs=1)


def test_a_batch_has_a_row_for_each_arm_of_a_run(batch, folder):
    rows = batch.table.rows()
    assert [row["scenario"] for row in rows] == [f"{NAME}.left", f"{NAME}.right"]
    assert rows[0]["run_id"] == f"{NAME}/rcm_inverse_dynamics/base-seed0.left"
    assert [row["success"] for row in rows] == [True, True]
    whole = json.loads((folder / "metrics.json").read_text())["metrics"]
    for row, arm in zip(rows, ("left", "right"), strict=True):
        assert row["tip_error_rms_mm"] == pytest.approx(whole[f"{arm}_tip_error_rms_mm"], rel=1e-9)
        assert batch[row["run_id"]].metrics["tip_error_rms_mm"] == row["tip_error_rms_mm"]


def test_the_report_follows_each_arm_over_time_and_has_the_scene_of_both(batch):
    rows, said = batch.table.rows(), []
    series = read_series(batch.folder, rows, [row["scenario"] for row in rows], said.append)
    for row in rows:
        errors = series[row["scenario"]].completed[row["controller"]]["tip_error_m"]
        assert np.nanmax(errors) == pytest.approx(row["tip_error_max_mm"], rel=1e-9)
    (scene,) = scene_process.main({"scenarios": [NAME], "draw": False})
    assert scene["robot"] == "panda and panda"


def test_what_cannot_be_started_is_a_row_for_each_arm(tmp_path):
    far = load_experiment(NAME, assignments=["arms.1.task.start_m=[0.05, 0.65, 0.5]"])
    assert do(Job(scenario_json=far.model_dump_json(), folder=str(tmp_path / "far"), record=False)) == REFUSED
    rows = read_rows(tmp_path, Row(run_id="far", suite="one", parameters={}, folder="far"))
    assert [(row["run_id"], row["outcome"], row["success"]) for row in rows] == [
        ("far.left", REFUSED, False),
        ("far.right", REFUSED, False),
    ]
    assert "arm right: " in rows[0]["outcome_detail"]


def test_exports_hold_both_arms_or_say_why_not(folder, trace, told, tmp_path, capsys):
    largest = 1e3 * max(trace[f"{arm}_tip_error_m"][200] for arm in trace.arms)
    assert f"tip  {largest:.3f} mm" in figures(trace, 200).replace("\u2007", " ")
    data, table = tmp_path / "run.parquet", tmp_path / "table.md"
    assert told("export", folder, "--data", data, "--table", table)[0] == 0
    columns = pq.read_table(data).column_names
    assert {"t_s", "left_q1_rad", "right_tip_x_m"} <= set(columns)
    assert [line.split("|")[1].strip() for line in table.read_text().splitlines()[2:]] == [
        f"{NAME}.left",
        f"{NAME}.right",
    ]
    assert main(["export", str(folder), "--minari", "two-v0"]) == 2
    assert "a run of several arms; episodes are of runs of one" in capsys.readouterr().err


def test_a_person_operates_one_arm_alone(capsys):
    assert main(["run", NAME, "--operator", "keyboard"]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert f"{NAME}: --operator takes a scenario of one arm; several are watched with --live" in said


def test_check_prints_a_scenario_that_is_the_same_again(told, tmp_path):
    status, printed = told("check", NAME)
    assert status == 0
    file = tmp_path / "again.yaml"
    file.write_text(printed)
    first, again = (
        next(line for line in text.splitlines() if line.startswith("# sha256"))
        for text in (printed, told("check", file)[1])
    )
    assert first == again
