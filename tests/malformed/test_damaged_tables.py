"""Results folders of a batch that an edit, a kill or a full disk has spoilt: refused, or done again."""

import hashlib
import json
import os
import random
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from batches import Here, short_run

from surgsim.cli.main import main
from surgsim.compare.columns import Table, csv_text
from surgsim.compare.table import keep_table, read_table, schema
from surgsim.errors import SurgsimError
from surgsim.recording.sealed import read_sealed, sealed

SUITE = f"""name: made
scenarios: [circle_lwr4plus]
controllers: [pinv, vprnn]
seeds: "0:2"
settings: {json.dumps(short_run(0.3))}
"""
RUN = Path("runs/circle_lwr4plus/vprnn/base-seed1")
NONE = "holds no runs.csv"
RESUME = ("compare", "suite.yaml", "--jobs", "1", "--out", "out", "--resume")


@pytest.fixture(scope="session")
def whole(tmp_path_factory) -> Path:
    """A finished batch, with its suite beside it."""
    folder = tmp_path_factory.mktemp("batch")
    (folder / "suite.yaml").write_text(SUITE)
    before = Path.cwd()
    os.chdir(folder)
    try:
        assert main(["compare", "suite.yaml", "--jobs", "1", "--out", "out"]) == 0
    finally:
        os.chdir(before)
    return folder


@pytest.fixture
def batch(whole, tmp_path) -> Path:
    """A copy of the batch in the folder that commands run in."""
    shutil.copytree(whole, tmp_path, dirs_exist_ok=True)
    return tmp_path / "out"


def _bytes(change: Callable[[bytes], bytes]) -> Callable[[Path], None]:
    return lambda path: path.write_bytes(change(path.read_bytes()))


def _table(change: Callable[[Table], Table]) -> Callable[[Path], None]:
    """Another table under the old checksum."""

    def spoil(path: Path) -> None:
        path.write_text(csv_text(change(read_table(path.parent))), encoding="utf-8", newline="")

    return spoil


def _kept(change: Callable[[Table], Table]) -> Callable[[Path], None]:
    """Another table with a checksum of its own: an edit by a program, not by the disk."""
    return lambda path: keep_table(path.parent, change(read_table(path.parent)))


def _column(name: str, values: Callable[[tuple[Any, ...]], list[Any]]) -> Callable[[Table], Table]:
    return lambda table: Table({**table.columns, name: tuple(values(table[name]))})


def _rows(change: Callable[[list[dict[str, Any]]], list[dict[str, Any]]]) -> Callable[[Table], Table]:
    return lambda table: Table.of_rows(change(table.rows()), schema())


def _resealed(change: Callable[[bytes], bytes]) -> Callable[[Path], None]:
    """Other bytes with a checksum of their own."""

    def spoil(path: Path) -> None:
        content = change(path.read_bytes())
        path.write_bytes(content)
        seal = f"{hashlib.sha256(content).hexdigest()}  {path.name}\n"
        path.with_name("runs.csv.sha256").write_text(seal, encoding="utf-8")

    return spoil


def _checksum(change: Callable[[Path], None]) -> Callable[[Path], None]:
    return lambda path: change(path.with_name("runs.csv.sha256"))


def _pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


def _folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


def _loop(path: Path) -> None:
    path.unlink()
    path.symlink_to(path.name)


OTHER = "does not hold what `surgsim compare` wrote"
CSV: dict[str, tuple[Callable[[Path], None], str]] = {
    "gone": (Path.unlink, NONE),
    "empty": (_bytes(lambda data: b""), OTHER),
    "half": (_bytes(lambda data: data[: len(data) // 2]), OTHER),
    "without its end": (_bytes(lambda data: data[:-8]), OTHER),
    "zeros": (_bytes(lambda data: bytes(len(data))), OTHER),
    "its middle zero": (_bytes(lambda data: data[:200] + bytes(600) + data[800:]), OTHER),
    "png": (_bytes(lambda data: b"\x89PNG\r\n\x1a\n" + data), OTHER),
    "pipe": (_pipe, NONE),
    "folder": (_folder, NONE),
    "loop": (_loop, NONE),
    "a row less": (_table(_rows(lambda rows: rows[1:])), OTHER),
    "a row twice": (_table(_rows(lambda rows: [*rows, rows[0]])), OTHER),
    "rows in another order": (_table(_rows(lambda rows: [rows[i] for i in (1, 0, 2, 3)])), OTHER),
    "a better figure": (
        _table(_column("tip_error_rms_mm", lambda found: [0.5 * found[0], *found[1:]])),
        OTHER,
    ),
    "another outcome": (_table(_column("outcome", lambda found: ["diverged", *found[1:]])), OTHER),
    "no checksum": (_checksum(Path.unlink), "holds no runs.csv.sha256"),
    "checksum empty": (_checksum(_bytes(lambda data: b"")), OTHER),
    "checksum half": (_checksum(_bytes(lambda data: data[:20])), OTHER),
    "checksum a pipe": (_checksum(_pipe), "holds no runs.csv.sha256"),
    "no column": (_kept(lambda table: table.without(["seed"])), "has no column 'seed'"),
    "another table": (_resealed(lambda data: b'"a"\n1\n'), "has no column 'run_id'"),
    "no rows": (_kept(_rows(lambda rows: [])), "has no rows"),
    "nothing, sealed": (_resealed(lambda data: b""), "has no column 'run_id'"),
    "text for seeds": (
        _resealed(lambda data: data.replace(b',0,"{}"', b',"0","{}"')),
        "column 'seed' holds '0', which is no integer",
    ),
    "a number for a name": (
        _resealed(lambda data: data.replace(b'"circle_lwr4plus"', b"3")),
        "column 'scenario' holds '3', which is no text",
    ),
    "a column twice": (_resealed(lambda data: data.replace(b'"suite"', b'"seed"')), "two columns of one"),
    "a cell less": (_resealed(lambda data: data.replace(b',0,"{}"', b',"{}"')), "cells, not"),
    "latin 1, sealed": (_resealed(lambda data: data.replace(b"circle", b"c\xf6rcle")), "is damaged: "),
    "no CSV, sealed": (_resealed(lambda data: data[:-2] + b'x"y\n'), "it is no CSV at character"),
    "cut, sealed": (_resealed(lambda data: data[:-1]), "it ends in the middle of a line"),
}


@pytest.mark.parametrize("command", [("report", "out"), ("inspect", "out", "--run", "x")])
@pytest.mark.parametrize("name", CSV)
def test_damaged_tables(name: str, command: tuple[str, ...], batch, refused) -> None:
    spoil, reason = CSV[name]
    spoil(batch / "runs.csv")
    (batch / "report.html").unlink()
    line = refused(*command)
    assert reason in line or (reason.startswith("holds no") and "the batch is not finished" in line)
    assert line.startswith("out")
    assert not (batch / "report.html").exists()


def test_no_flipped_bit_changes_a_table(batch) -> None:
    path, rng = batch / "runs.csv", random.Random(2)
    table, data = read_table(batch), path.read_bytes()
    refusals = 0
    for _ in range(300):
        place = rng.randrange(len(data))
        flipped = bytes([data[place] ^ 1 << rng.randrange(8)])
        path.write_bytes(data[:place] + flipped + data[place + 1 :])
        reason = _refusal(batch, table)
        assert reason.isprintable()
        refusals += bool(reason)
    assert refusals == 300


def _refusal(folder: Path, table: Table) -> str:
    """Why the table is refused; empty if it is read and is `table`."""
    try:
        assert read_table(folder) == table
    except SurgsimError as error:
        return str(error)
    return ""


def _edited(**changes: Any) -> Callable[[Path], None]:
    """Sealed again after the change: an edit by a program, not by the disk."""

    def spoil(path: Path) -> None:
        content = read_sealed(path)
        path.write_text(json.dumps(sealed({**content, **changes})), encoding="utf-8")

    return spoil


def _text(old: str, new: str) -> Callable[[Path], None]:
    def spoil(path: Path) -> None:
        text = path.read_text(encoding="utf-8")
        assert old in text
        path.write_text(text.replace(old, new, 1), encoding="utf-8")

    return spoil


SUITE_JSON: dict[str, tuple[Callable[[Path], None], str]] = {
    "empty": (_bytes(lambda data: b""), "suite.json is damaged: "),
    "half": (_bytes(lambda data: data[: len(data) // 2]), "suite.json is damaged: "),
    "zeros": (_bytes(lambda data: bytes(len(data))), "suite.json is damaged: "),
    "latin 1": (_bytes(lambda data: b"\xf6" + data), "suite.json is damaged: "),
    "list": (_bytes(lambda data: b"[1]"), "suite.json is damaged: it holds no object"),
    "deep": (_bytes(lambda data: b"[" * 100_000), "suite.json is damaged: it is nested too deeply"),
    "a version changed": (_text('"python": "3.', '"python": "4.'), "suite.json is damaged: it does not hold"),
    "no seal": (_bytes(lambda data: b'{"name": "made"}'), "suite.json is damaged: it has no sha256"),
}


@pytest.mark.parametrize("command", [("report", "out"), RESUME])
@pytest.mark.parametrize("name", SUITE_JSON)
def test_damaged_suite_json(name: str, command: tuple[str, ...], batch, refused) -> None:
    spoil, reason = SUITE_JSON[name]
    spoil(batch / "suite.json")
    assert reason in refused(*command)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"schema_version": 2}, "out holds the results of another suite, or of other settings"),
        ({"seeds": "0:3"}, "out holds the results of another suite, or of other settings"),
        ({"settings": []}, "out holds the results of another suite, or of other settings"),
    ],
)
def test_results_of_another_suite(changes: dict[str, Any], reason: str, batch, refused) -> None:
    _edited(**changes)(batch / "suite.json")
    assert refused(*RESUME) == reason


@pytest.mark.parametrize("name", ["suite.json", "runs.csv"])
def test_results_without_resume(name: str, batch, refused) -> None:
    (batch / name).unlink()
    line = refused(*RESUME[:-1])
    assert line.startswith("out holds ")


METRICS_JSON: dict[str, Callable[[Path], None]] = {
    "gone": Path.unlink,
    "empty": _bytes(lambda data: b""),
    "half": _bytes(lambda data: data[: len(data) // 2]),
    "zeros": _bytes(lambda data: bytes(len(data))),
    "list": _bytes(lambda data: b"[]"),
    "deep": _bytes(lambda data: b"[" * 100_000),
    "latin 1": _bytes(lambda data: data.replace(b"vprnn", b"vpr\xf6\xf6")),
    "a figure changed": _text('"tip_error_rms_mm": ', '"tip_error_rms_mm": 9'),
    "an outcome changed": _text('"completed"', '"diverged"'),
    "no seal": _bytes(lambda data: b'{"scenario": "circle_lwr4plus"}'),
    "pipe": _pipe,
    "folder": _folder,
    "loop": _loop,
}


@pytest.mark.usefixtures("without_scenes")
@pytest.mark.parametrize("name", METRICS_JSON)
def test_a_damaged_run_is_not_counted_but_done_again(name: str, batch, whole, monkeypatch) -> None:
    """Resuming is the cure: the run is found not to be whole, and only it is run."""
    monkeypatch.chdir(batch.parent)
    METRICS_JSON[name](batch / RUN / "metrics.json")
    others = {
        path: path.stat().st_mtime_ns
        for path in batch.glob("runs/*/*/[!.]*/metrics.json")
        if RUN.name not in str(path)
    }
    runner = Here()
    monkeypatch.setattr("surgsim.compare.choice.run_jobs", runner)
    assert main(list(RESUME)) == 0
    assert runner.folders == [str(Path("out") / RUN)]
    assert {path: path.stat().st_mtime_ns for path in others} == others
    again, first = (read_table(folder).rows() for folder in (batch, whole / "out"))
    keys = ("run_id", "outcome", "tip_error_rms_mm", "rcm_error_max_mm")
    assert [[row[key] for key in keys] for row in again] == [[row[key] for key in keys] for row in first]


def test_there_are_enough() -> None:
    assert len(CSV) + len(SUITE_JSON) + len(METRICS_JSON) >= 40
