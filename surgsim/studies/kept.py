"""Measured cases on the disk, so that a study that was interrupted goes on where it was."""

import hashlib
import json
import sys
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from surgsim.recording.files import replacing
from surgsim.runs.provenance import provenance
from surgsim.runs.sources import package_sha256
from surgsim.studies.study import Case, Measured

_ROW = "row as JSON"


def write_measured(folder: Path, measured: Measured) -> None:
    """Keep a measured case in the folder, whole or not at all."""
    folder.mkdir(parents=True, exist_ok=True)
    path = _path(folder, measured.case)
    arrays: dict[str, Any] = {_ROW: np.array(json.dumps(dict(measured.row))), **measured.curves}
    with replacing(path) as draft, draft.open("wb") as file:
        np.savez(file, **arrays)


def read_measured(folder: Path, case: Case) -> Measured | None:
    """The measured case, if the folder has it from the same sources; None otherwise."""
    try:
        with _path(folder, case).open("rb") as file, np.load(file, allow_pickle=False) as stored:
            row = json.loads(str(stored[_ROW]))
            curves = {name: stored[name] for name in stored.files if name != _ROW}
    except (FileNotFoundError, zipfile.BadZipFile, KeyError, ValueError):
        return None
    return Measured(case=case, row=row, curves=curves)


@contextmanager
def kept_until_whole(study: Path) -> Iterator[Path]:
    """A hidden sibling of a study's folder for measured cases; it is removed if the block ends well."""
    place = study.resolve()
    folder = place.parent / f".{place.name}.cases"
    yield folder
    for path in folder.glob("*.npz"):
        path.unlink()
    with suppress(OSError):  # it was not needed, or holds what is not ours
        folder.rmdir()


def _path(folder: Path, case: Case) -> Path:
    kind = type(case)
    named = f"{kind.__module__}.{kind.__qualname__} {case!r} {_sources(kind.__module__)}"
    return folder / f"{hashlib.sha256(named.encode()).hexdigest()[:32]}.npz"


@lru_cache
def _sources(module: str) -> str:
    """What results of a module's cases depend on: sources, packages, the studies and the module."""
    found = provenance()
    files = (Path(__file__).parent, Path(str(sys.modules[module].__file__)))
    hashes = [package_sha256(file) for file in files]
    return json.dumps([found["sources_sha256"], found["packages"], found["machine"], hashes], sort_keys=True)
