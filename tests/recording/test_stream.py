"""Recordings are made in memory: no thread and no memory of one stays, and a disk that refuses says so."""

import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest
import rerun as rr
import rerun.blueprint as rrb

from surgsim.errors import RecordingError, SurgsimError
from surgsim.recording.framing import check_framing
from surgsim.recording.stream import FLUSH_TIMEOUT_S, stream_to
from surgsim.recording.write import write_recording


def threads() -> int:
    return len(os.listdir("/proc/self/task")) if Path("/proc").is_dir() else threading.active_count()


def resident_mb() -> float:
    pages = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="only Linux says how much memory is used")
def test_no_thread_and_no_memory_of_a_recording_stays(trace, metrics, tmp_path):
    """rerun keeps four threads and 5 MB of each recording that it writes by itself."""
    for _ in range(10):
        write_recording(tmp_path / "recording.rrd", trace, metrics)
    threads_before, memory_before = threads(), resident_mb()
    for _ in range(30):
        write_recording(tmp_path / "recording.rrd", trace, metrics)
    assert threads() <= threads_before
    assert resident_mb() - memory_before < 30.0


def test_the_layout_is_the_one_that_rerun_sends_itself(tmp_path):
    """The same chunks of a blueprint's store as by `RecordingStream.save`."""
    blueprint = rrb.Blueprint(rrb.Spatial3DView(name="of the test"))
    theirs = rr.RecordingStream("surgsim", recording_id="one", send_properties=False)
    theirs.save(tmp_path / "theirs.rrd", default_blueprint=blueprint)
    theirs.flush(timeout_sec=10.0)
    theirs.disconnect()
    with stream_to(tmp_path / "ours.rrd", blueprint, recording_id="one"):
        pass
    ours, theirs = ((tmp_path / f"{name}.rrd").read_bytes() for name in ("ours", "theirs"))
    assert b"of the test" in ours
    assert len(ours) == pytest.approx(len(theirs), rel=0.02)
    check_framing(tmp_path / "ours.rrd")


def test_an_encoder_that_fails_is_told_in_one_line(tmp_path, monkeypatch):
    def read(self, **options):
        assert options == {"flush_timeout_sec": FLUSH_TIMEOUT_S}
        raise RuntimeError("Flush timed out")

    monkeypatch.setattr("rerun.recording_stream.BinaryStream.read", read)
    refusal = pytest.raises(RecordingError, match=r"x\.rrd: cannot be recorded: Flush timed out$")
    with refusal, stream_to(tmp_path / "x.rrd", rrb.Blueprint()):
        pass
    assert os.listdir(tmp_path) == []


def test_a_disk_that_refuses_is_told_in_one_line_and_nothing_is_left(trace, metrics, tmp_path, monkeypatch):
    real = os.write

    def write(handle, content):
        if len(content) > 10_000:
            raise OSError(28, "No space left on device")
        return real(handle, content)

    monkeypatch.setattr(os, "write", write)
    with pytest.raises(SurgsimError) as error:
        write_recording(tmp_path / "x.rrd", trace, metrics)
    assert str(error.value) == f"{tmp_path / 'x.rrd'}: cannot be written: No space left on device"
    assert os.listdir(tmp_path) == []


def test_the_layout_is_active_and_not_the_default_alone(tmp_path):
    """A browser has made a layout of its own by the time that a default one arrives."""
    with stream_to(tmp_path / "x.rrd", rrb.Blueprint(rrb.Spatial3DView(name="of the test"))):
        pass
    viewer = "import sys; from rerun_cli.__main__ import main; sys.exit(main())"
    words = [sys.executable, "-P", "-c", viewer, "rrd", "print", "-v", str(tmp_path / "x.rrd")]
    done = subprocess.run(words, capture_output=True, text=True, timeout=100, check=True)
    assert "make_active: true, make_default: true" in done.stdout
