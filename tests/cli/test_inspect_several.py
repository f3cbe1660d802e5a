"""`surgsim inspect` with two recordings, and with a batch's folder."""

import json
import math
import shutil
from pathlib import Path

import pytest
from batches import Here, short_run
from rerun.chunk import RrdReader

from surgsim.cli.inspect_pair import _shown, differing, largest_gap_mm
from surgsim.cli.main import main
from surgsim.compare.columns import Table
from surgsim.compare.engine import Batch, compare
from surgsim.compare.suite import SuiteConfig
from surgsim.compare.table import read_table, schema
from surgsim.display import number
from surgsim.metrics.catalog import METRICS
from surgsim.metrics.timing import TIMING_METRICS
from surgsim.recording.layout import HEADER, SERIES, TIMELINE
from surgsim.recording.read import read_recording
from surgsim.recording.sealed import read_sealed, sealed
from surgsim.trace.trace import Trace

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
        settings=short_run(),
    )

    assert compare(Batch(suite=suite, folder=Path(), out=out), runner=Here()) is not None
    return out


@pytest.fixture(scope="module")
def runs(batch):
    return [str(batch / "runs" / name) for name in (A, B)]


def test_two_recordings_are_compared(runs, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert main(["inspect", *runs]) == 0
    out, error = capsys.readouterr()
    assert error == ""
    lines = out.splitlines()
    assert lines[:7] == [
        f"a: {runs[0]}",
        f"b: {runs[1]}",
        "",
        "What differs",
        "setting          a     b",
        "controller.name  pinv  joint_impedance",
        "",
    ]
    assert (lines[7], lines[8].split()) == ("Metrics", ["metric", "a", "b", "b", "-", "a"])
    stored = [json.loads((Path(run) / "metrics.json").read_text())["metrics"] for run in runs]
    shown = [name for name in METRICS if any(metrics[name] is not None for metrics in stored)]
    assert [line.split()[0] for line in lines[9:-2]] == shown
    assert len(shown) < len(METRICS), "what neither has is left out"
    largest = float(lines[-1].removeprefix("largest distance between the two tips: ").split()[0])
    assert 1.0 < largest < 10.0
    assert list(tmp_path.iterdir()) == [], "nothing is written unless asked for"


def test_a_long_value_is_cut_between_words_and_between_numbers():
    text = "LWR4+ follows a circle (R 2 cm) through a fixed trocar"
    assert _shown(text) == "LWR4+ follows a circle (R 2 cm) through ..."
    numbers = [1.5708, -0.5236, 0.0, 1.5708, 0.0, -1.0472, 0.5]
    assert _shown(numbers) == "[1.5708, -0.5236, 0.0, 1.5708, 0.0, ..."
    assert (_shown("a" * 60), _shown(None)) == ("a" * 60, "-")


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
        shown = {f"/{side}{path}" for path in own_paths if not path.startswith((f"/{HEADER}", "/__"))}
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
        f"{runs[0]} holds no runs.csv: it is no folder of batch results": [
            runs[0],
            "--run",
            A,
        ],
    }
    for text, words in wrong.items():
        assert main(["inspect", *words]) == 2
        out, error = capsys.readouterr()
        assert (out, error) == ("", f"surgsim: {text}\n")


def said(command, capsys):
    """Standard error of a command that is refused."""
    assert main(command) == 2
    out, error = capsys.readouterr()
    assert (out, error.count("\n")) == ("", 1)
    return error


def write_command(folder, command):
    about = read_sealed(folder / "suite.json")
    (folder / "suite.json").write_text(json.dumps(sealed({**about, "command": command})))


@pytest.fixture
def copy(batch, tmp_path):
    """A copy of the batch that may be spoilt, made by a command of its own."""
    copy = shutil.copytree(batch, tmp_path / "copy")
    write_command(copy, "surgsim compare pair.yaml --out 'my runs' --resume")
    return copy


def test_a_run_without_recording_says_how_to_record_it(copy, capsys):
    (copy / "runs" / A / "recording.rrd").unlink()
    assert said(["inspect", str(copy), "--run", A], capsys) == (
        f"surgsim: {A} was not recorded. To record every run: surgsim compare pair.yaml --out 'my runs' "
        f"--resume --record. To record this one: surgsim run {copy}/runs/{A}/scenario.yaml --out DIR\n"
    )
    write_command(copy, "")
    assert f"surgsim compare SUITE --out {copy} --resume --record." in said(
        ["inspect", str(copy), "--run", A], capsys
    )


@pytest.mark.parametrize("more", [[], ["--run", A], ["--json"]])
def test_a_batch_that_is_not_finished_says_how_to_go_on(copy, capsys, more):
    (copy / "runs.csv.sha256").unlink()
    (copy / "runs" / B / "metrics.json").unlink()
    assert said(["inspect", str(copy), *more], capsys) == (
        f"surgsim: {copy}: the batch is not finished: 1 run there, no table yet. "
        "To go on: surgsim compare pair.yaml --out 'my runs' --resume\n"
    )


@pytest.fixture
def listed(copy, monkeypatch):
    """Rows of the batch's table with changes, which `inspect` will read in place of its own."""

    def change(changes):
        table = read_table(copy)
        rows = [{**row, **changes(row)} for row in table.rows()]
        changed = Table.of_rows(rows, schema())
        monkeypatch.setattr("surgsim.compare.table.read_table", lambda root: changed)
        return rows

    return change


def test_long_names_are_listed_whole(copy, listed, capsys):
    """On a line of their own, so that they can be copied, though numbers stand beside them."""
    rows = listed(lambda row: {"run_id": f"{row['run_id']}/{'x' * 150}"})
    assert main(["inspect", str(copy)]) == 0
    out = capsys.readouterr().out
    for row in rows:
        line = next(line for line in out.splitlines() if line.startswith(row["run_id"]))
        figures = [row[key] for key in ("tip_error_rms_mm", "rcm_error_rms_mm", "rcm_error_max_mm")]
        assert [float(word) for word in line.split()[2:]] == pytest.approx(figures, rel=1e-3)


def test_a_batch_without_recordings_says_how_to_record_them(copy, listed, capsys):
    listed(lambda row: {"recording": None})
    assert main(["inspect", str(copy)]) == 0
    said = "none was recorded; to record them: surgsim compare pair.yaml --out 'my runs' --resume --record"
    assert capsys.readouterr().out.splitlines()[-1] == said


@pytest.mark.parametrize(("gap_m", "text"), [(0.0, "0"), (3e-17, "3.000e-14"), (0.002, "2.000")])
def test_the_distance_of_the_tips_is_told_however_small(runs, gap_m, text):
    still, moved = (tip_traces(read_recording(Path(runs[0])).trace, x) for x in (0.0, gap_m))
    assert number(largest_gap_mm(still, moved)) == text


def test_ticks_at_which_a_tip_is_not_finite_do_not_count(runs):
    trace = read_recording(Path(runs[0])).trace
    still, moved = tip_traces(trace, 0.0), tip_traces(trace, 0.002, broken=1)
    assert largest_gap_mm(still, moved) == pytest.approx(2.0)
    assert largest_gap_mm(still, tip_traces(trace, 0.0, broken=len(trace))) is None


def tip_traces(trace, x_m, broken=0):
    """`trace` with its tip at `x_m` on the x axis, but for the last `broken` ticks, where it is nowhere."""
    data = trace.data.copy()
    first = trace.columns.index("tip_x_m")
    data[:, first : first + 3] = (x_m, 0.0, 0.0)
    data[len(data) - broken :, first] = math.nan
    return Trace(data, trace.blocks, trace.meta)


def test_what_differs_of_two_scenarios():
    a = {"seed": 0, "task": {"type": "circle", "radius_m": 0.02}, "disturbances": [{"type": "push", "x": 1}]}
    b = {"seed": 1, "task": {"type": "circle", "radius_m": 0.01}, "disturbances": [{"type": "push", "x": 2}]}
    assert list(differing(a, a)) == []
    assert list(differing(a, b)) == [
        ("seed", 0, 1),
        ("task.radius_m", 0.02, 0.01),
        ("disturbances.0.x", 1, 2),
    ]
    other = {"task": {"type": "spiral", "turns": 2}, "disturbances": []}
    assert list(differing(a, other)) == [
        ("seed", 0, None),
        ("task.type", "circle", "spiral"),
        ("disturbances", [{"type": "push", "x": 1}], []),
    ]


def test_the_same_run_twice_is_said_to_be_the_same(runs, capsys):
    assert main(["inspect", runs[0], runs[0]]) == 0
    assert "\nThe scenarios are the same.\n" in capsys.readouterr().out


def test_a_run_without_recording_says_what_it_is(copy, capsys):
    run = copy / "runs" / A
    (run / "recording.rrd").unlink()
    assert said(["inspect", str(run)], capsys) == (
        f"surgsim: {run}: a run without recording, circle_lwr4plus with pinv, completed; "
        f"its metrics are in metrics.json. To record it: surgsim run {run}/scenario.yaml --out DIR\n"
    )


def test_a_folder_of_runs_or_of_batches_says_what_it_is(copy, batch, capsys):
    folder = copy / "runs" / "circle_lwr4plus"
    (folder / ".draft.part").mkdir()
    (folder / ".draft.part" / "metrics.json").write_text("{}")
    assert said(["inspect", str(folder)], capsys) == (
        f"surgsim: {folder}: a folder of 2 runs: {folder}/joint_impedance/base-seed0, "
        f"{folder}/pinv/base-seed0. To look into one: surgsim inspect {folder}/joint_impedance/base-seed0\n"
    )
