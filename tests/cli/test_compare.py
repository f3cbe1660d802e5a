"""`surgsim compare` as a user types it."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from batches import short_run

from surgsim.cli.main import main
from surgsim.compare.job import CRASHED, WORKER_DIED, do, write_failure
from surgsim.compare.table import read_table
from surgsim.compare.workers import Done

SUITE = f"""\
name: tiny
scenarios: [circle_lwr4plus]
controllers: [pinv, vprnn]
seeds: "0:2"
settings: {json.dumps([*short_run(), "disturbances=[{type: payload, spread: 0.5}]"])}
"""
RUN_LINE = r"tiny: 4 of 4 runs, 0 failed, about 0 s to go"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("compare")
    (made / "tiny.yaml").write_text(SUITE)
    return made


@pytest.fixture(scope="module")
def surgsim(folder):
    def run(*words):
        command = [sys.executable, "-W", "error", "-m", "surgsim", *words]
        environment = {**os.environ, "NO_COLOR": "1"}
        return subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True, timeout=200
        )

    return run


@pytest.fixture(scope="module")
def done(surgsim):
    """A finished comparison, in runs/suites/tiny."""
    return surgsim("compare", "tiny.yaml", "--jobs", "2")


def test_it_ends_with_a_leaderboard(done, folder):
    assert done.returncode == 0, done.stderr
    assert "pinv" in done.stdout
    assert "vprnn" in done.stdout
    assert "RCM error, RMS" in done.stdout
    out = folder / "runs" / "suites" / "tiny"
    assert sorted(path.name for path in out.iterdir()) == [
        "report.html",
        "runs",
        "runs.csv",
        "runs.csv.sha256",
        "runs.parquet",
        "suite.json",
    ]
    table = read_table(out)
    assert table["outcome"] == ("completed",) * 4
    about = json.loads((out / "suite.json").read_text())
    assert about["command"] == "surgsim compare tiny.yaml --jobs 2"


def test_progress_and_what_was_written_are_on_stderr(done):
    lines = [line for line in done.stderr.splitlines() if not line.startswith("compil")]
    assert re.fullmatch(RUN_LINE, lines[-3])
    assert lines[-2:] == [
        "4 runs; wrote runs/suites/tiny/runs.csv",
        "wrote runs/suites/tiny/report.html",
    ]


@pytest.mark.usefixtures("without_scenes")
def test_results_that_are_there_are_kept_unless_resumed(surgsim, done, folder, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    assert main(["compare", "tiny.yaml"]) == 2
    assert capsys.readouterr() == (
        "",
        "surgsim: runs/suites/tiny holds results; give --resume to go on with them, or another --out\n",
    )
    assert main(["compare", "tiny.yaml", "--resume", "--json", "--metric", "tip_error_rms_mm"]) == 0
    out, error = capsys.readouterr()
    assert "0 failed" not in error, "nothing was run again"
    rows = json.loads(out)
    assert [(row["runs"], row["completed"]) for row in rows] == [(2, 2), (2, 2)]
    assert {row["controller"] for row in rows} == {"pinv", "vprnn"}


@pytest.mark.usefixtures("without_scenes")
def test_shards_from_the_command_line(capsys, monkeypatch, folder, done):
    monkeypatch.chdir(folder)
    words = ["compare", "tiny.yaml", "--out", "shards", "--jobs", "1"]
    assert main([*words, "--shard", "1/2"]) == 1
    text = "shards: other shards' runs are missing; --resume makes the table once they are there\n"
    assert capsys.readouterr().out == text
    assert main([*words, "--shard", "2/2"]) == 0
    columns = ["run_id", "outcome", "tip_error_rms_mm", "rcm_error_max_mm"]
    whole, found = read_table(folder / "runs" / "suites" / "tiny"), read_table(folder / "shards")
    assert [found[name] for name in columns] == [whole[name] for name in columns]


WRONG = {
    "suite and scenario": (["quick", "circle_lwr4plus"], "give one suite, or scenarios; not both"),
    "neither": (["nonsense"], "'nonsense' is not a shipped suite or scenario. Known: "),
    "mistyped": (["qiuck"], "'qiuck' is not a shipped suite or scenario. Known: "),
    "set nothing": (
        ["quick", "--set", "task.radios_m=1"],
        "--set task.radios_m=1: task.radios_m: unknown key",
    ),
    "set a seed": (["quick", "--set", "seed=3"], "--set seed=3: the seeds of a suite are given by --seeds"),
    "set a controller": (
        ["quick", "--set", "controller=qp"],
        "--set controller=qp: the controllers of a suite are given by --controllers",
    ),
    "set what is varied": (
        ["frontier", "--set", "disturbances=[]"],
        "--set disturbances=[]: suite 'frontier' varies this itself: ",
    ),
    "no file": (["nothing.yaml"], "nothing.yaml: cannot be read: "),
    "controller": (["quick", "--controllers", "vprn"], "--controller: 'vprn' is not a shipped controller."),
    "seeds": (["quick", "--seeds", "x"], "--seeds: 'x' is not a list of seeds: write 0:10, 3 or 1,4,9"),
    "jobs": (["quick", "--jobs", "0"], "--jobs: 0 is not allowed: must be 1 or more"),
    "shard": (["quick", "--shard", "4/3"], "--shard: '4/3' is not I/N with 1 <= I <= N"),
    "shard 0": (["quick", "--shard", "0/3"], "--shard: '0/3' is not I/N with 1 <= I <= N"),
    "no shard": (["quick", "--shard", "2"], "--shard: '2' is not I/N with 1 <= I <= N"),
    "metric": (["quick", "--metric", "rcm_error_rms"], "'rcm_error_rms' is not a metric. Known: "),
    "address": (["quick", "--address", "host:6379"], "--address is for --engine ray"),
    "foreign out": (
        ["quick", "--out", "."],
        ". holds files that are not batch results; choose another --out",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_said_before_anything_is_run(capsys, monkeypatch, tmp_path, name):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "other.txt").write_text("")
    words, text = WRONG[name]
    assert main(["compare", *words]) == 2
    out, error = capsys.readouterr()
    assert out == ""
    assert error.startswith(f"surgsim: {text}")
    assert error.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["other.txt"]


@pytest.mark.usefixtures("without_scenes")
def test_a_batch_with_crashed_runs_is_no_success(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tiny.yaml").write_text(SUITE)

    def run(jobs, count):
        ends = [CRASHED, "completed", WORKER_DIED, "completed"]
        for index, (job, end) in enumerate(zip(jobs, ends, strict=True)):
            if end == "completed":
                yield Done(index=index, outcome=do(job))
            else:
                write_failure(job.scenario(), Path(job.folder), end, "by the test")
                yield Done(index=index, outcome=end)

    monkeypatch.setattr("surgsim.compare.choice.run_jobs", run)
    assert main(["compare", "tiny.yaml"]) == 1
    error = capsys.readouterr().err.splitlines()
    assert error[-1] == (
        "surgsim: 2 of 4 runs crashed or lost their worker: circle_lwr4plus/pinv/base-seed0, "
        "circle_lwr4plus/vprnn/base-seed0; outcome_detail in runs.csv says how"
    )
    assert (tmp_path / "runs" / "suites" / "tiny" / "report.html").is_file()
