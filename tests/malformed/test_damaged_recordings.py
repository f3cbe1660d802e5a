"""Recordings that a disk, a kill or another program has spoilt: refused, or the trace has the same bits."""

import hashlib
import json
import os
import random
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pyarrow as pa
import pytest
import rerun as rr

from surgsim.metrics.catalog import compute_metrics
from surgsim.recording.encoding import encode
from surgsim.recording.layout import HEADER, SEAL, SERIES, Header, seal
from surgsim.recording.read import read_recording
from surgsim.recording.write import log_header, write_recording
from surgsim.simulate.loop import simulate
from surgsim.trace.trace import Trace

FLIPS = 60


@pytest.fixture(scope="session")
def trace(scenario) -> Trace:
    return simulate(scenario())


@pytest.fixture(scope="session")
def recording(trace, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("whole") / "recording.rrd"
    write_recording(path, trace, compute_metrics(trace))
    return path


def _bodies(data: bytes) -> list[tuple[int, int]]:
    """First byte and size of every message's body."""
    found, at = [], 12
    while True:
        kind, size = struct.unpack_from("<QQ", data, at)
        found.append((at + 16, size))
        at += 16 + size
        if kind == 0:
            return found


def _without(data: bytes, index: int) -> bytes:
    at, size = _bodies(data)[index]
    return data[: at - 16] + data[at + size :]


def _twice(data: bytes, index: int) -> bytes:
    at, size = _bodies(data)[index]
    return data[: at + size] + data[at - 16 :]


def _largest(data: bytes, rank: int) -> int:
    bodies = _bodies(data)
    return sorted(range(len(bodies)), key=lambda i: -bodies[i][1])[rank]


def _patched(data: bytes, at: int, new: bytes) -> bytes:
    return data[:at] + new + data[at + len(new) :]


def _cut(part: float) -> Callable[[bytes], bytes]:
    return lambda data: data[: int(part * len(data))]


def _of_rank(change: Callable[[bytes, int], bytes], rank: int) -> Callable[[bytes], bytes]:
    return lambda data: change(data, _largest(data, rank))


def _zeroed(part: float, size: int) -> Callable[[bytes], bytes]:
    return lambda data: _patched(data, int(part * len(data)), bytes(size))


BYTES: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda data: b"",
    "one byte": lambda data: data[:1],
    "magic alone": lambda data: data[:4],
    "header alone": lambda data: data[:12],
    "header and half a message": lambda data: data[:100],
    **{f"cut at {part:g}": _cut(part) for part in (0.1, 0.25, 0.5, 0.75, 0.9, 0.99)},
    "cut before the footer": lambda data: data[:-32],
    "cut in the footer": lambda data: data[:-5],
    "one byte more": lambda data: data + b"\0",
    "twice": lambda data: data * 2,
    "first half twice": lambda data: data[: len(data) // 2] * 2,
    "magic": lambda data: b"RRF9" + data[4:],
    "old magic": lambda data: b"RRF0" + data[4:],
    "version": lambda data: _patched(data, 4, b"\x63"),
    "encoding": lambda data: _patched(data, 8, b"\x07"),
    "size of a message": lambda data: _patched(data, 20, b"\xff" * 8),
    "kind of a message": lambda data: _patched(data, 12, b"\x09"),
    "png": lambda data: b"\x89PNG\r\n\x1a\n" + data[8:],
    "zip": lambda data: b"PK\x03\x04" + data[4:],
    "text": lambda data: b"schema_version: 1\nname: circle\n" * 99,
    "reversed": lambda data: data[::-1],
    "half zero": lambda data: data[: len(data) // 2] + bytes(len(data) - len(data) // 2),
    "footer zero": lambda data: data[:-32] + bytes(32),
}
SLOW: dict[str, Callable[[bytes], bytes]] = {
    "largest message zero": lambda data: _patched(data, _bodies(data)[_largest(data, 0)][0] + 64, bytes(512)),
    "a sector zero": _zeroed(0.5, 4096),
    "without its first message": lambda data: _without(data, 0),
    "without its largest message": _of_rank(_without, 0),
    "its largest message twice": _of_rank(_twice, 0),
}


def _write(path: Path, texts: dict[str, str], packed: bytes, *, application: str = "surgsim") -> None:
    """A recording with these texts and packed columns, sealed like a whole one."""
    with rr.RecordingStream(application) as stream:
        stream.save(path)
        log_header(stream, texts, packed, seal(packed, texts))
        stream.flush()
    stream.disconnect()


def _texts(trace: Trace, **changes: str) -> dict[str, str]:
    return {**Header.of(trace, compute_metrics(trace)).to_texts(), **changes}


def _sealed_with(path: Path, trace: Trace, **changes: str) -> None:
    _write(path, _texts(trace, **changes), encode(trace.data))


def _foreign(path: Path, trace: Trace) -> None:
    _write(path, _texts(trace), encode(trace.data), application="someone_else")


def _no_header(path: Path, trace: Trace) -> None:
    with rr.RecordingStream("surgsim") as stream:
        stream.save(path)
        stream.log(f"{SERIES}/q", rr.Scalars([0.0]))
        stream.flush()
    stream.disconnect()


def _no_columns(path: Path, trace: Trace) -> None:
    """As a program before the columns were packed wrote it: a sealed header without them."""
    texts = _texts(trace)
    with rr.RecordingStream("surgsim") as stream:
        stream.save(path)
        stream.log(HEADER, rr.AnyValues(**texts, **{SEAL: seal(b"", texts)}), static=True)
        stream.flush()
    stream.disconnect()


def _no_column(path: Path, trace: Trace) -> None:
    _write(path, _texts(trace), encode(trace.data[:, :-1]))


def _block_left_out(path: Path, trace: Trace) -> None:
    """Whole and sealed, but the tip is not among its blocks: another program wrote it."""
    keep = [i for i, name in enumerate(trace.columns) if not name.startswith("tip_")]
    blocks = tuple(block for block in trace.blocks if not block.columns[0].startswith("tip_"))
    other = Trace(trace.data[:, keep], blocks, trace.meta)
    _write(path, Header.of(other, compute_metrics(trace)).to_texts(), encode(other.data))


def _changed_value(path: Path, trace: Trace) -> None:
    texts, data = _texts(trace), trace.data.copy()
    data[7, 3] += 1e-9
    packed, whole = encode(data), encode(trace.data)
    _write(path, texts, packed)
    sealed, wanted = seal(packed, texts).encode(), seal(whole, texts).encode()
    assert sealed in path.read_bytes()
    path.write_bytes(path.read_bytes().replace(sealed, wanted))


def _narrow(path: Path, trace: Trace) -> None:
    packed = encode(trace.data)
    half = pa.compress(trace.data.astype("float32").tobytes(), codec="zstd", asbytes=True)
    _write(path, _texts(trace), packed[: len(trace.columns)] + half)


def _rows(rows: int) -> Callable[[Path, Trace], None]:
    def make(path: Path, trace: Trace) -> None:
        layout = json.loads(_texts(trace)["layout"])
        _sealed_with(path, trace, layout=json.dumps({**layout, "rows": rows}))

    return make


def _meta_without(key: str) -> Callable[[Path, Trace], None]:
    def make(path: Path, trace: Trace) -> None:
        meta = json.loads(trace.meta.to_json())
        where = meta if key in meta else meta["scenario"]
        del where[key]
        _sealed_with(path, trace, trace_meta=json.dumps(meta))

    return make


MADE: dict[str, Callable[[Path, Trace], None]] = {
    "another program's": _foreign,
    "no header": _no_header,
    "a column missing": _no_column,
    "a block left out": _block_left_out,
    "a number changed": _changed_value,
    "no packed columns": _no_columns,
    "numbers of half the width": _narrow,
    **{f"{rows} rows": _rows(rows) for rows in (-1, 0, 1, 10**10, 10**30)},
    "columns that are not packed": lambda path, trace: _write(path, _texts(trace), trace.data.tobytes()),
    "an older schema version": lambda path, trace: _sealed_with(path, trace, schema_version="1"),
    "a later schema version": lambda path, trace: _sealed_with(path, trace, schema_version="99"),
    "no meta data": lambda path, trace: _sealed_with(path, trace, trace_meta="{}"),
    "meta data nested": lambda path, trace: _sealed_with(path, trace, trace_meta="[" * 100_000),
    "metrics no mapping": lambda path, trace: _sealed_with(path, trace, metrics="[1]"),
    "metrics text": lambda path, trace: _sealed_with(path, trace, metrics='{"sparc": "smooth"}'),
    "layout cut": lambda path, trace: _sealed_with(path, trace, layout='{"blocks": ['),
    "no limits": _meta_without("limits"),
    "no scenario": _meta_without("scenario"),
    "a scenario without controller": _meta_without("controller"),
}


def test_there_are_enough() -> None:
    assert len(BYTES) + len(SLOW) + len(MADE) >= 45


@pytest.mark.parametrize("name", [*BYTES, *SLOW])
def test_damaged_bytes(name: str, recording, refused, tmp_path) -> None:
    (tmp_path / "run.rrd").write_bytes({**BYTES, **SLOW}[name](recording.read_bytes()))
    assert refused("inspect", "run.rrd").startswith("run.rrd: ")


@pytest.mark.parametrize("name", MADE)
def test_recordings_that_no_surgsim_wrote(name: str, trace, refused, tmp_path) -> None:
    MADE[name](tmp_path / "run.rrd", trace)
    assert refused("inspect", "run.rrd").startswith("run.rrd: ")


@pytest.mark.parametrize("options", [["--json"], ["--export", "out.csv"], ["--export", "out.parquet"]])
def test_nothing_is_exported_from_a_damaged_one(options: list[str], recording, refused, tmp_path) -> None:
    (tmp_path / "run.rrd").write_bytes(recording.read_bytes()[:-40])
    assert refused("inspect", "run.rrd", *options).startswith("run.rrd: damaged recording")
    assert [path.name for path in tmp_path.iterdir()] == ["run.rrd"]


def test_a_damaged_one_beside_a_whole_one(recording, refused, tmp_path) -> None:
    (tmp_path / "run.rrd").write_bytes(recording.read_bytes()[:-40])
    assert refused("inspect", recording, "run.rrd").startswith("run.rrd: damaged recording")


def test_no_table_of_another_kind(recording, refused, tmp_path) -> None:
    assert "cannot export to '.xlsx'. Allowed: .csv, .parquet." in refused(
        "inspect", recording, "--export", "x.xlsx"
    )


_READ_ALL = """
import sys, hashlib
from pathlib import Path
from surgsim.recording.extract import extract
from surgsim.recording.framing import check_framing
for name in sys.argv[1:]:
    print(name, end=" ", flush=True)
    try:
        check_framing(Path(name))
        texts, data = extract(Path(name))
        print(hashlib.sha256(data.tobytes()).hexdigest(), flush=True)
    except BaseException:
        print("refused", flush=True)
"""


def _read_all(names: list[str], folder: Path) -> dict[str, str]:
    """What reading each file gives; rerun may end the process, and the rest is read by another one."""
    found: dict[str, str] = {}
    paths = {**os.environ, "PYTHONPATH": os.pathsep.join(entry or os.getcwd() for entry in sys.path)}
    while left := [name for name in names if name not in found]:
        command = [sys.executable, "-P", "-c", _READ_ALL, *left]
        done = subprocess.run(command, cwd=folder, env=paths, capture_output=True, text=True, timeout=60)
        pairs = [line.split() for line in done.stdout.splitlines()]
        assert pairs, done.stderr
        found |= {pair[0]: pair[1] if len(pair) > 1 else "refused" for pair in pairs}
    return found


def test_no_flipped_bit_changes_a_trace(recording, trace, tmp_path) -> None:
    """A bit in a chunk that only the viewer shows may pass; one in the trace or its header never does."""
    data, rng = recording.read_bytes(), random.Random(1)
    places = [rng.randrange(len(data)) for _ in range(FLIPS // 2)]
    bodies = _bodies(data)
    places += [at + rng.randrange(size) for at, size in rng.choices(bodies[:-1], k=FLIPS // 2)]
    for i, place in enumerate(places):
        flipped = bytes([data[place] ^ 1 << rng.randrange(8)])
        (tmp_path / f"{i}.rrd").write_bytes(_patched(data, place, flipped))
    (tmp_path / "whole.rrd").write_bytes(data)
    found = _read_all([*(f"{i}.rrd" for i in range(FLIPS)), "whole.rrd"], tmp_path)
    same = hashlib.sha256(trace.data.tobytes()).hexdigest()
    assert found["whole.rrd"] == same
    assert set(found.values()) == {same, "refused"}
    assert len(found) == FLIPS + 1


def test_the_whole_one_is_whole(recording, trace) -> None:
    assert read_recording(recording).trace.equals(trace)
