import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from surgsim.errors import Outcome, RecordingError, SurgsimError
from surgsim.recording.extract import extract
from surgsim.recording.read import read_recording
from surgsim.recording.write import write_recording
from surgsim.simulate.loop import simulate
from surgsim.trace.trace import Ending, Trace, TraceMeta


def bits(trace: Trace) -> np.ndarray:
    return trace.data.view(np.uint64)


def content(path: Path) -> dict[str, list[object]]:
    """Everything in the file but ids and times of writing."""
    found: dict[str, list[object]] = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        names = [name for name in batch.schema.names if "RowId" not in name and name != "log_time"]
        found.setdefault(chunk.entity_path, []).append(
            {name: batch.column(name).to_pylist() for name in names}
        )
    return {path: sorted(chunks, key=repr) for path, chunks in found.items()}


def test_everything_comes_back_bit_for_bit(trace: Trace, metrics, recording: Path) -> None:
    recorded = read_recording(recording)
    assert np.array_equal(bits(recorded.trace), bits(trace))
    assert recorded.trace.columns == trace.columns
    assert recorded.trace.blocks == trace.blocks
    assert recorded.trace.meta.to_json() == trace.meta.to_json()
    assert recorded.metrics == metrics
    assert not recorded.trace.data.flags.writeable


def test_a_run_folder_stands_for_its_recording(trace: Trace, recording: Path) -> None:
    assert read_recording(recording.parent).trace.equals(trace)


def test_two_writes_hold_the_same(trace: Trace, metrics, recording: Path, tmp_path: Path) -> None:
    again = tmp_path / "again.rrd"
    write_recording(again, trace, metrics)
    first, second = content(recording), content(again)
    first.pop("/log"), second.pop("/log")  # rows of the log carry the time of writing
    assert repr(sorted(first.items())) == repr(sorted(second.items()))
    assert RrdReader(again).recordings() == RrdReader(recording).recordings()


def test_writing_replaces_and_leaves_nothing_else(trace: Trace, tmp_path: Path) -> None:
    path = tmp_path / "r.rrd"
    path.write_text("old")
    write_recording(path, trace, {})
    assert [file.name for file in tmp_path.iterdir()] == ["r.rrd"]
    assert np.array_equal(extract(path)[1].view(np.uint64), bits(trace))


def test_one_row_and_a_failed_run(trace: Trace, tmp_path: Path) -> None:
    ending = Ending(outcome=Outcome.RCM_LIMIT, t_s=0.0, detail="51 mm", data={"H": np.eye(2)})
    meta = TraceMeta(
        scenario=trace.meta.scenario,
        control_period_s=trace.meta.control_period_s,
        limits=trace.meta.limits,
        ending=ending,
    )
    write_recording(tmp_path / "r.rrd", Trace(trace.data[:1], trace.blocks, meta), {})
    texts, data = extract(tmp_path / "r.rrd")
    assert data.shape == (1, len(trace.columns))
    assert TraceMeta.from_json(texts["trace_meta"]).to_json() == meta.to_json()
    log = content(tmp_path / "r.rrd")["/log"]
    assert "The shaft moved further from the trocar" in repr(log)
    assert "WARN" in repr(log)


def test_a_kinematic_run_without_trocar_and_theatre(scenario, tmp_path: Path) -> None:
    run = simulate(scenario("plant={type: kinematic}", "trocar=null"))
    assert np.isnan(run["tau1_nm"]).all()
    write_recording(tmp_path / "r.rrd", run, {})
    assert np.array_equal(extract(tmp_path / "r.rrd")[1].view(np.uint64), bits(run))


def test_an_unwritable_path(trace: Trace, tmp_path: Path) -> None:
    with pytest.raises(SurgsimError, match="cannot be written: No such file or directory"):
        write_recording(tmp_path / "absent" / "r.rrd", trace, {})


def test_reading_does_not_import_rerun() -> None:
    code = "import surgsim.recording.read, surgsim.recording.view, sys; sys.exit('rerun' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("version", [2, 4])
def test_a_recording_of_another_schema_version(
    trace: Trace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, version: int
) -> None:
    path = tmp_path / "r.rrd"
    monkeypatch.setattr("surgsim.recording.layout.SCHEMA_VERSION", version)
    write_recording(path, trace, {})
    monkeypatch.undo()
    with pytest.raises(RecordingError) as caught:
        read_recording(path)
    assert str(caught.value) == f"{path}: recording of schema version {version}; this surgsim reads 3"
