"""Damaged and foreign files are refused in one line, whatever rerun does with them."""

import struct
import time
from pathlib import Path

import pytest
import rerun as rr

from surgsim.errors import RecordingError
from surgsim.recording.encoding import encode
from surgsim.recording.framing import check_framing
from surgsim.recording.read import read_recording


def refusal(path: Path) -> str:
    began = time.monotonic()
    with pytest.raises(RecordingError) as caught:
        read_recording(path)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(f"{path}: ")
    assert time.monotonic() - began < 30.0
    return message.removeprefix(f"{path}: ")


@pytest.mark.parametrize("kept", [3, 4, 11, 12, 20, 1000, 0.3, 0.7, -40, -32, -20, -1])
def test_cut_short(recording: Path, tmp_path: Path, kept: float) -> None:
    whole = recording.read_bytes()
    path = tmp_path / "cut.rrd"
    path.write_bytes(whole[: int(kept * len(whole)) if isinstance(kept, float) else kept])
    assert refusal(path).startswith("is not a rerun" if kept == 3 else "damaged recording")


def test_something_appended(recording: Path, tmp_path: Path) -> None:
    path = tmp_path / "long.rrd"
    path.write_bytes(recording.read_bytes() + b"\0")
    assert refusal(path).startswith("damaged recording")


def message_bodies(data: bytes) -> list[tuple[int, int]]:
    """First byte and size of every message's body."""
    found, at = [], 12
    while True:
        kind, size = struct.unpack_from("<QQ", data, at)
        found.append((at + 16, size))
        at += 16 + size
        if kind == 0:
            return found


@pytest.mark.parametrize(
    "place", ["magic", "version", "encoding", "size", "first message", "largest message", "footer"]
)
def test_flipped_bytes(recording: Path, tmp_path: Path, place: str) -> None:
    data = bytearray(recording.read_bytes())
    bodies = message_bodies(data)
    largest, size = max(bodies, key=lambda body: body[1])
    at = {
        "magic": 1,
        "version": 5,
        "encoding": 8,
        "size": 26,
        "first message": bodies[0][0],
        "largest message": largest + size // 2,
        "footer": len(data) - 10,
    }[place]
    for i in range(at, at + 2):
        data[i] ^= 0xFF
    path = tmp_path / "flipped.rrd"
    path.write_bytes(data)
    assert refusal(path)


def test_a_changed_bit_of_the_packed_columns_is_noticed(recording: Path, tmp_path: Path, trace) -> None:
    """The file still reads as a recording."""
    data, packed = recording.read_bytes(), encode(trace.data)
    middle = len(packed) // 2
    place = data.index(packed[middle : middle + 16])
    path = tmp_path / "changed.rrd"
    path.write_bytes(data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :])
    check_framing(path)
    assert refusal(path) == "damaged recording: it does not hold what was written"


def test_a_foreign_recording(tmp_path: Path) -> None:
    path = tmp_path / "foreign.rrd"
    with rr.RecordingStream("someone_else") as stream:
        stream.save(path)
        stream.log("points", rr.Points3D([[0.0, 0.0, 0.0]]))
        stream.flush()
    stream.disconnect()
    assert refusal(path) == "not a recording of one surgsim run, but of someone_else"


def test_a_surgsim_recording_without_header(tmp_path: Path) -> None:
    path = tmp_path / "other.rrd"
    with rr.RecordingStream("surgsim") as stream:
        stream.save(path)
        stream.log("points", rr.Points3D([[0.0, 0.0, 0.0]]))
        stream.flush()
    stream.disconnect()
    assert refusal(path) == "damaged recording: its header is missing"


@pytest.mark.parametrize(
    ("content", "reason"),
    [(b"", "is empty"), (b"schema_version: 1\nname: circle\n" * 99, "is not a rerun recording")],
)
def test_no_recording_at_all(tmp_path: Path, content: bytes, reason: str) -> None:
    path = tmp_path / "file.rrd"
    path.write_bytes(content)
    assert refusal(path) == reason


def test_missing(tmp_path: Path) -> None:
    assert refusal(tmp_path / "absent.rrd") == "cannot be read: No such file or directory"
    with pytest.raises(RecordingError, match=r"recording\.rrd: cannot be read: No such file"):
        read_recording(tmp_path)


def test_a_device() -> None:
    assert refusal(Path("/dev/zero")) == "is not a file"
