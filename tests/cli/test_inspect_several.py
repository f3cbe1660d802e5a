"""`surgsim inspect` with two recordings, and with a batch's folder."""

import json
import shutil
from pathlib import Path

import pytest
from rerun.chunk import RrdReader

from surgsim.cli.main import main
from surgsim.compare.engine import Batch, compare
from surgsim.compare.job import do
from surgsim.compare.suite import SuiteConfig
from surgsim.compare.workers import Done
from surgsim.metrics.catalog import METRICS
from surgsim.metrics.timing import TIMING_METRICS
from surgsim.recording.layout import HEADER, SERIES, TIMELINE

SETTINGS = (
    "theatre=false",
    "task.duration_s=0.2",
    "task.ramp_s=0.1",
    "task.hold_start_s=0",
    "task.hold_end_s=0",
    "task.radius_m=0.002",
)
A, B = "circle_lwr4plus/pinv/base-seed0", "circle_lwr4plus/joint_impedance/base-seed0"


@pytest.fixture(scope="module")
def batch(tmp_path_factory) -> Path:
    """A batch of two recorded runs."""
    out = tmp_path_factory.mktemp("batch") / "pair"
    suite = SuiteConfig(
        name="pair",
        scenarios=("circle_lwr4plus",),
        controllers=("pinv", "joint_impedance"),
        record=True,
        settings=SETTINGS,
    )

    def here(jobs, count):
        for index, job in enumerate(jobs):
            yield Done(index=index, outcome=do(job))

    assert compare(Batch(suite=suite, folder=Path(), out=out), runner=here) is not None
    return out


@pytest.fixture(scope="module")
def runs(batch):
    return [str(batch / "runs" / name) for name in (A, B)]


def test_two_recordings_are_compared(runs, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert main(["inspect", *runs]) == 0
    out, error = capsys.readouterr()
    assert error == ""
    assert out.splitlines()[0].rstrip() == "circle_lwr4plus"
    assert out.splitlines()[1].split() == ["metric", "pinv", "joint_impedance", "difference"]
    assert {line.split()[0] for line in out.splitlines()[2 : 2 + len(METRICS)]} == set(METRICS)
    largest = float(out.splitlines()[-1].removeprefix("largest distance between the two tips: ").split()[0])
    assert 1.0 < largest < 10.0
    assert list(tmp_path.iterdir()) == [], "nothing is written unless asked for"


def test_the_difference_as_json(runs, batch, capsys):
    assert main(["inspect", *runs, "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    for side, run in zip("ab", runs, strict=True):
        stored = json.loads((Path(run) / "metrics.json").read_text())["metrics"]
        for name in set(METRICS) - TIMING_METRICS:
            assert printed[side][name] == stored[name]
    a, b = printed["a"]["tip_error_rms_mm"], printed["b"]["tip_error_rms_mm"]
    assert printed["b_minus_a"]["tip_error_rms_mm"] == b - a != 0.0


def test_a_run_differs_in_nothing_from_itself(runs, capsys):
    assert main(["inspect", runs[0], runs[0], "--json"]) == 0
    gaps = json.loads(capsys.readouterr().out)["b_minus_a"]
    assert {value for value in gaps.values() if value is not None} == {0.0}


def test_out_writes_both_on_one_timeline(runs, capsys, tmp_path):
    file = tmp_path / "made" / "pair.rrd"
    assert main(["inspect", *runs, "--out", str(file)]) == 0
    assert capsys.readouterr().err == f"wrote {file}\n"
    paths, ticks = contents(file)
    alone = [contents(Path(run) / "recording.rrd") for run in runs]
    for side, (own_paths, own_ticks) in zip("ab", alone, strict=True):
        assert len(own_ticks) > 5
        shown = {
            f"/{side}{path}"
            for path in own_paths
            if not path.startswith((f"/{HEADER}", "/__", "/summary/", "/log"))
        }
        assert shown == {path for path in paths if path.startswith(f"/{side}/")}
        mine = {path: n for path, n in ticks.items() if path.startswith(f"/{side}/")}
        assert mine == {f"/{side}{path}": n for path, n in own_ticks.items()}
    assert [path.name for path in file.parent.iterdir()] == ["pair.rrd"]


def contents(file):
    """Entity paths of a recording, and how many points of its one timeline each series has."""
    paths: set[str] = set()
    ticks: dict[str, int] = {}
    for chunk in RrdReader(file).stream():
        batch = chunk.to_record_batch()
        paths.add(chunk.entity_path)
        if TIMELINE in batch.schema.names and f"/{SERIES}/" in f"{chunk.entity_path}/":
            ticks[chunk.entity_path] = ticks.get(chunk.entity_path, 0) + len(batch)
    return paths, ticks


def test_a_batch_lists_its_runs(batch, capsys):
    assert main(["inspect", str(batch)]) == 0
    out = capsys.readouterr().out
    assert "2 runs of" in out
    assert A in out
    assert B in out
    assert out.count("completed") == 2
    assert main(["inspect", str(batch), "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["run_id"] for row in rows] == [A, B]


def test_any_run_of_a_batch_can_be_opened(batch, runs, capsys):
    assert main(["inspect", str(batch), "--run", B, "--json"]) == 0
    of_batch = json.loads(capsys.readouterr().out)
    assert main(["inspect", runs[1], "--json"]) == 0
    assert of_batch == json.loads(capsys.readouterr().out)
    assert of_batch["differences"] == []


def test_a_run_of_two_batches_is_compared(batch, capsys):
    assert main(["inspect", str(batch), str(batch), "--run", A, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["b_minus_a"]["rcm_error_rms_mm"] == 0.0


def test_what_is_wrong_is_one_line(batch, runs, capsys, tmp_path):
    wrong = {
        f"'nothing' is not a run of {batch}. Known: {B}, {A}.": [str(batch), "--run", "nothing"],
        "inspect takes one recording, two, or a batch's folder": [*runs, runs[0]],
        "--export takes one recording": [*runs, "--export", str(tmp_path / "x.parquet")],
        f"{runs[0]} holds no runs.parquet: it is no folder of batch results, or not finished": [
            runs[0],
            "--run",
            A,
        ],
    }
    for text, words in wrong.items():
        assert main(["inspect", *words]) == 2
        out, error = capsys.readouterr()
        assert (out, error) == ("", f"surgsim: {text}\n")


def test_a_run_without_recording_says_so(batch, capsys, tmp_path):
    copy = shutil.copytree(batch, tmp_path / "copy")
    (copy / "runs" / A / "recording.rrd").unlink()
    assert main(["inspect", str(copy), "--run", A]) == 2
    assert "recording.rrd" in capsys.readouterr().err
