"""A run's folder is written whole or not at all, and its scenario gives the run again."""

import hashlib
import json
import os
import signal
import subprocess
import sys
import time

import pytest

from surgsim.errors import SurgsimError
from surgsim.runs.folder import check_target, run_to_folder, whole_folder
from surgsim.scenario.load import load_scenario
from surgsim.scenario.yaml_text import dump_yaml
from surgsim.simulate.loop import simulate

FILES = {"scenario.yaml", "metrics.json", "recording.rrd"}


def _names(folder):
    return {path.name for path in folder.iterdir()}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("runs") / "deep" / "run"


@pytest.fixture(scope="module")
def result(scenario, folder):
    return run_to_folder(scenario(seed=7), folder, record=False)


def test_the_folder_holds_the_run(result, folder, scenario):
    assert _names(folder) == FILES - {"recording.rrd"}
    assert _names(folder.parent) == {"run"}
    summary = json.loads((folder / "metrics.json").read_text())
    assert summary["schema_version"] == 2
    assert (summary["scenario"], summary["controller"], summary["seed"]) == ("circle_lwr4plus", "vprnn", 7)
    assert summary["outcome"]["name"] == "completed"
    assert summary["outcome"]["t_s"] == pytest.approx(0.3)
    assert summary["metrics"] == dict(result.metrics)
    assert summary["provenance"]["scenario_sha256"] == scenario(seed=7).sha256()
    assert summary["provenance"]["packages"]["mujoco"]


def test_its_scenario_run_again_gives_the_same_trace(result, folder):
    again = load_scenario(str(folder / "scenario.yaml"))
    assert again.seed == 7
    assert simulate(again).equals(result.trace)


def test_its_summary_states_size_and_hash_of_every_other_file(tmp_path, scenario):
    run_to_folder(scenario(), tmp_path / "run")
    stated = json.loads((tmp_path / "run" / "metrics.json").read_text())["files"]
    assert stated == {
        name: {"bytes": len(content), "sha256": hashlib.sha256(content).hexdigest()}
        for name in FILES - {"metrics.json"}
        for content in [(tmp_path / "run" / name).read_bytes()]
    }


def test_a_run_that_starts_singular_is_written_with_the_reason_of_its_missing_metric(tmp_path, scenario):
    changes = ("trocar=null", "task.start_m=null", "start.q_rad=[0,0,0,0,0,0,0]")
    result = run_to_folder(scenario(*changes), tmp_path / "run", record=False)
    reason = "the arm is singular in this run: its self-motion cannot be followed"
    summary = json.loads((tmp_path / "run" / "metrics.json").read_text())
    assert summary["outcome"]["name"] == "infeasible"
    assert summary["metrics"]["manipulability_optimality"] is None
    assert summary["undefined"] == dict(result.undefined) == {"manipulability_optimality": reason}


def test_an_earlier_run_is_replaced_as_a_whole(tmp_path, scenario):
    folder = tmp_path / "run"
    with whole_folder(folder) as draft:
        (draft / "metrics.json").write_text("{}")
        (draft / "recording.rrd").write_text("of the earlier run")
    run_to_folder(scenario(), folder, record=False)
    assert _names(folder) == FILES - {"recording.rrd"}
    assert _names(tmp_path) == {"run"}


def test_an_empty_folder_is_filled(tmp_path):
    folder = tmp_path / "run"
    folder.mkdir()
    with whole_folder(folder) as draft:
        (draft / "metrics.json").write_text("{}")
    assert _names(folder) == {"metrics.json"}


def test_a_folder_that_is_no_run_is_refused_before_anything_is_simulated(tmp_path, scenario):
    (tmp_path / "thesis.txt").write_text("precious")
    with pytest.raises(SurgsimError, match=r"holds 'thesis\.txt', which is not a run's"):
        run_to_folder(scenario(), tmp_path)
    assert _names(tmp_path) == {"thesis.txt"}
    with pytest.raises(SurgsimError, match="is a file; --out names a folder"):
        check_target(tmp_path / "thesis.txt")


def test_a_folder_with_more_than_a_run_in_it_is_refused(tmp_path):
    (tmp_path / "metrics.json").write_text("{}")
    (tmp_path / "thesis.txt").write_text("precious")
    with pytest.raises(SurgsimError):
        check_target(tmp_path)


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_when_writing_fails_the_earlier_run_stays_and_nothing_else(tmp_path, error):
    folder = tmp_path / "run"
    with whole_folder(folder) as draft:
        (draft / "metrics.json").write_text("earlier")

    def fail():
        with whole_folder(folder) as draft:
            (draft / "metrics.json").write_text("half")
            raise error

    with pytest.raises(error):
        fail()
    assert (folder / "metrics.json").read_text() == "earlier"
    assert _names(tmp_path) == {"run"}


def test_a_disk_that_refuses_is_the_user_s_to_mend(tmp_path):
    (tmp_path / "file").write_text("")
    with (
        pytest.raises(SurgsimError, match=r"cannot write .*file/run"),
        whole_folder(tmp_path / "file" / "run"),
    ):
        pass


def _wait_for_draft(folder, process):
    until = time.monotonic() + 60.0
    while time.monotonic() < until and process.poll() is None:
        if list(folder.glob(".run.*.part")):
            return
        time.sleep(0.002)
    pytest.fail(f"no draft appeared; exit status {process.poll()}")


def test_a_killed_run_leaves_no_half_folder(tmp_path, scenario):
    (tmp_path / "mine.yaml").write_text(dump_yaml(scenario().resolved()))
    command = [sys.executable, "-m", "surgsim", "run", "mine.yaml", "--out", "out/run"]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        _wait_for_draft(tmp_path / "out", process)
    finally:
        os.kill(process.pid, signal.SIGKILL)
        process.wait(timeout=60)
    left = _names(tmp_path / "out")
    assert process.returncode == -signal.SIGKILL
    assert "run" not in left
    assert all(name.startswith(".run.") and name.endswith(".part") for name in left)
    subprocess.run([*command, "--no-record"], cwd=tmp_path, check=True, capture_output=True, timeout=60)
    assert _names(tmp_path / "out" / "run") == FILES - {"recording.rrd"}
