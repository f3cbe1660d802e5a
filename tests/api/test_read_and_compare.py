"""`surgsim.compare`, `surgsim.read`, and what a batch shows."""

import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import pandas as pd
import pytest

import surgsim
from surgsim.errors import RecordingError, ScenarioError

RUN = "circle_lwr4plus/qp/base-seed1"


def test_a_batch_is_a_mapping_of_its_runs(batch):
    found = surgsim.read(batch)
    assert len(found) == 4
    assert list(found)[-1] == RUN
    assert (found.controllers, found.scenarios) == (["pinv", "qp"], ["circle_lwr4plus"])
    run = found[RUN]
    assert (run.controller, run.seed, run.outcome) == ("qp", 1, "completed")
    with pytest.raises(
        KeyError, match=r"'circle_lwr4plus/qp/base-seed7' is not a run of this batch. Did you"
    ):
        found["circle_lwr4plus/qp/base-seed7"]


def test_a_run_that_was_not_recorded_says_how_to_get_its_trace(batch):
    run = surgsim.read(batch)[RUN]
    with pytest.raises(
        RecordingError, match=r"was not recorded, so it has no trace\. surgsim\.run\('.*yaml'\)"
    ):
        run.trace  # noqa: B018
    again = surgsim.run(run.folder / "scenario.yaml")
    assert again.metrics["tip_error_rms_mm"] == run.metrics["tip_error_rms_mm"]


def test_its_table_and_its_leaderboard(batch):
    found = surgsim.read(batch)
    frame = found.to_pandas()
    assert isinstance(frame, pd.DataFrame)
    assert frame["outcome"].tolist() == list(found.table["outcome"]) == ["completed"] * 4
    assert (frame["trocar_force_max_n"].dtype, frame["trocar_force_max_n"].isna().all()) == (float, True)
    board = found.leaderboard("tip_error_rms_mm")
    assert repr(board).startswith("Nobody wins by tip error")
    means = frame.groupby("controller")["tip_error_rms_mm"].mean()
    assert {row.controller: row.value.value for row in board} == pytest.approx(means.to_dict())
    with pytest.raises(surgsim.SurgsimError, match=r"'tip' is not a metric\. Known"):
        found.leaderboard("tip")


def test_it_shows_itself_within_80_columns_and_in_html(batch):
    found = surgsim.read(batch)
    for shown in (found, found.leaderboard()):
        assert max(map(len, repr(shown).splitlines())) <= 80
        assert shown._repr_html_().count("<tr>") == 3
    assert repr(found).startswith("Comparison of 4 runs, 1 scenario, 2 controllers, 2 seeds\n")


def test_its_page(batch, tmp_path):
    found = surgsim.read(batch)
    page = tmp_path / "page.html"
    assert found.report(str(page)) == page
    assert page.read_text().startswith("<!DOCTYPE html>")
    assert found.report() == batch / "report.html"


def test_without_out_the_results_live_as_long_as_the_object(quick, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = surgsim.compare("circle_lwr4plus", controllers="pinv", jobs=1, record=True, **quick)
    folder = found.folder
    assert next(iter(found.values())).trace["t_s"][-1] == pytest.approx(0.3)
    assert list(tmp_path.iterdir()) == []
    del found
    assert not folder.exists()


def test_a_run_keeps_the_folder_it_is_read_from(quick):
    found = surgsim.compare("circle_lwr4plus", controllers="pinv", jobs=1, record=True, **quick)
    folder, run = found.folder, found["circle_lwr4plus/pinv/base-seed0"]
    del found
    assert run.trace["t_s"][-1] == pytest.approx(0.3)
    assert folder.is_dir()
    del run
    assert not folder.exists()


def test_the_table_is_not_read_again(batch, monkeypatch):
    found = surgsim.read(batch)
    monkeypatch.setattr("surgsim.report.results.read_table", lambda folder: pytest.fail("read again"))
    assert found.controllers == ["pinv", "qp"]
    assert len(found.leaderboard()) == 2
    assert found.report() == batch / "report.html"


def test_the_caller_s_script_is_hidden_only_while_a_process_starts(quick, tmp_path, monkeypatch):
    main, seen = sys.modules["__main__"], []
    before = (main.__spec__, getattr(main, "__file__", None))

    @contextmanager
    def shown(label):
        yield lambda *_: seen.append((main.__spec__, getattr(main, "__file__", None)))

    monkeypatch.setattr("surgsim.api.comparing.show_batch_progress", shown)
    options = {"controllers": "pinv", "jobs": 1, "out": tmp_path / "out", "progress": True}
    surgsim.compare("circle_lwr4plus", **options, **quick)
    assert seen == [before]


def test_a_batch_goes_on_and_one_of_other_settings_is_refused(batch, quick, tmp_path):
    out = tmp_path / "batch"
    shutil.copytree(batch, out)
    again = {"controllers": ["pinv", "qp"], "seeds": "0:2", "jobs": 1, "out": out, **quick}
    (lost,) = out.glob("runs/circle_lwr4plus/qp/base-seed1")
    shutil.rmtree(lost)
    with pytest.raises(surgsim.SurgsimError, match=r"holds results; give --resume"):
        surgsim.compare("circle_lwr4plus", **again)
    assert len(surgsim.compare("circle_lwr4plus", resume=True, **again)) == 4
    assert lost.is_dir()
    with pytest.raises(
        surgsim.SurgsimError, match=r"holds the results of another suite, or of other settings"
    ):
        surgsim.compare("circle_lwr4plus", resume=True, **{**again, "seeds": 0})


def test_scenarios_and_controllers_are_taken_as_content_too(quick, tmp_path):
    small = surgsim.load("circle_lwr4plus", name="small", **quick)
    tree = {**small.resolved(), "name": "smaller", "task": {**small.resolved()["task"], "radius_m": 0.001}}
    stiff = {**small.controller.model_dump(mode="json"), "name": "stiff"}
    options = {"controllers": ["pinv", stiff], "jobs": 1, "out": tmp_path / "out"}
    found = surgsim.compare([small, tree], **options)
    assert (found.scenarios, found.controllers) == (["small", "smaller"], ["pinv", "stiff"])
    assert found["smaller/stiff/base-seed0"].scenario.task.radius_m == 0.001
    again = surgsim.compare([small, tree], resume=True, **options)
    assert again.table == found.table
    tree["task"]["radius_m"] = 0.0015
    with pytest.raises(
        surgsim.SurgsimError, match="holds the results of another suite, or of other settings"
    ):
        surgsim.compare([small, tree], resume=True, **options)
    with pytest.raises(surgsim.SurgsimError, match="two of the scenarios are called 'small'"):
        surgsim.compare([small, small])


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"seeds": "x"}, "--seeds: 'x' is not a list of seeds: write 0:10, 3 or 1,4,9"),
        ({"seeds": []}, "--seeds: '' is not a list of seeds: write 0:10, 3 or 1,4,9"),
        ({"jobs": 0}, "--jobs: 0 is not allowed: must be 1 or more"),
        ({"engine": "rai"}, "--engine: 'rai' is not allowed. Allowed: local, ray."),
        ({"address": "host:1"}, "--address is for --engine ray"),
        ({"settings": {"seed": 3}}, "--set seed=3: the seeds of a suite are given by --seeds"),
        ({"tsk": {"radius_m": 0.1}}, "--set tsk.radius_m=0.1: tsk: unknown key"),
        ({"controllers": []}, "give controllers; the list is empty"),
        ({"controllers": [3]}, "a int is no controller: give a name, a path or a mapping"),
        ({"matters": {"tip": 1.0}}, "'tip' is not a metric. Known"),
        ({"matters": {"sparc": -1}}, "--matters: 'sparc=-1' is not METRIC=VALUE with a value of 0 or more"),
        ({"matters": {"sparc": float("nan")}}, "--matters: 'sparc=nan' is not METRIC=VALUE with a value"),
        ({"matters": {"sparc": "1"}}, "--matters: 'sparc=1' is not METRIC=VALUE with a value of 0 or more"),
        ({"controllers": ["vprn"]}, "--controller: 'vprn' is not a shipped controller. Known"),
    ],
)
def test_bad_options_are_refused_before_anything_runs(options, text):
    with pytest.raises(surgsim.SurgsimError) as caught:
        surgsim.compare("circle_lwr4plus", **options)
    assert str(caught.value).startswith(text)


def test_a_suite_cannot_be_mixed_with_scenarios():
    with pytest.raises(surgsim.SurgsimError, match=r"^give one suite, or scenarios; not both$"):
        surgsim.compare(["quick", "circle_lwr4plus"])
    with pytest.raises(ScenarioError, match=r"^'circl' is not a shipped suite or scenario"):
        surgsim.compare("circl")


def test_a_lone_recording_is_a_run(folder, made):
    run = surgsim.read(folder / "recording.rrd")
    assert (run.folder, run.outcome, run.provenance) == (None, "completed", {})
    assert run.scenario == made.scenario
    assert dict(run.metrics) == dict(surgsim.read(folder).metrics)


def test_what_is_neither_run_nor_batch_says_what_is_missing(tmp_path, batch, folder):
    with pytest.raises(RecordingError, match=r"holds neither a run nor a batch: no metrics\.json, no runs\."):
        surgsim.read(tmp_path)
    with pytest.raises(RecordingError, match=r"nothing.rrd: cannot be read: No such file or directory"):
        surgsim.read(tmp_path / "nothing.rrd")
    unfinished = tmp_path / "unfinished"
    shutil.copytree(batch, unfinished)
    (unfinished / "runs.csv.sha256").unlink()
    shutil.copytree(unfinished / "runs" / RUN, (unfinished / "runs" / RUN).with_name(".base-seed9.x.part"))
    with pytest.raises(surgsim.SurgsimError, match=r"the batch is not finished: 4 runs there, no table yet"):
        surgsim.read(unfinished)
    damaged = tmp_path / "damaged"
    shutil.copytree(folder, damaged)
    file = damaged / "metrics.json"
    file.write_text(file.read_text().replace('"seed": 3', '"seed": 4'))
    with pytest.raises(RecordingError, match=r"is damaged: it does not hold what was written"):
        surgsim.read(damaged)


SCRIPT = """
import surgsim
print("begun", flush=True)
found = surgsim.compare(
    "circle_lwr4plus", controllers=["pinv"], seeds=range({seeds}), jobs=2, out={out!r}, resume=True,
    theatre=False, task={task!r},
)
print(len(found))
"""


def script(tmp_path, quick, seeds):
    file = tmp_path / "script.py"
    file.write_text(SCRIPT.format(seeds=seeds, out=str(tmp_path / "out"), task=quick["task"]))
    return subprocess.Popen(
        [sys.executable, str(file)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def test_a_script_without_a_main_guard_is_not_run_again_by_the_workers(tmp_path, quick):
    with script(tmp_path, quick, 2) as process:
        out, error = process.communicate(timeout=180)
    assert (out, error) == ("begun\n2\n", "")


def test_an_interrupt_leaves_whole_runs_alone_and_the_batch_goes_on(tmp_path, quick):
    with script(tmp_path, quick, 12) as process:
        deadline = time.monotonic() + 120.0
        while not list(tmp_path.glob("out/runs/*/*/[!.]*/metrics.json")) and time.monotonic() < deadline:
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=60)
    assert error.strip().endswith("KeyboardInterrupt")
    there = [path.name for path in tmp_path.glob("out/runs/*/*/*")]
    assert 0 < len(there) < 12
    assert not [name for name in there if name.startswith(".")]
    with script(tmp_path, quick, 12) as process:
        out, error = process.communicate(timeout=180)
    assert (out, error) == ("begun\n12\n", "")
