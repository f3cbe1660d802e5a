"""What a run's folder holds: `metrics.json` states size and hash of every other file in it."""

import hashlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from surgsim.errors import RecordingError
from surgsim.recording.sealed import read_sealed

SUMMARY = "metrics.json"


def contents_of(folder: Path) -> dict[str, dict[str, Any]]:
    """Size [bytes] and SHA-256 of every file in a run's folder but `metrics.json`.

    Raises:
        OSError: If one cannot be read.
    """
    names = sorted(path.name for path in folder.iterdir() if path.name != SUMMARY)
    return {name: _content(folder / name) for name in names}


def fault_of(folder: Path, summary: Mapping[str, Any]) -> str:
    """Which file of a run is missing or damaged, by what its `metrics.json` states; nothing if it is whole.

    Raises:
        KeyError: If `summary` states no files.
        TypeError: If it states something else.
    """
    for name, stated in summary["files"].items():
        try:
            found = os.stat(folder / name).st_size
            if found != stated["bytes"]:
                return f"{name} is damaged: it has {found} bytes, and had {stated['bytes']}"
            if _content(folder / name) != stated:
                return f"{name} is damaged: it does not hold what was written"
        except FileNotFoundError:
            return f"{name} is missing"
        except OSError as error:
            return f"{name} cannot be read: {error.strerror or error}"
    return ""


def check_contents(folder: Path) -> None:
    """Refuse a run's folder of which a file is not as it was written; pass one without `metrics.json`.

    Raises:
        RecordingError: If it is damaged.
    """
    if not (folder / SUMMARY).exists():
        return
    try:
        fault = fault_of(folder, read_sealed(folder / SUMMARY))
    except (OSError, ValueError) as error:
        fault = f"{SUMMARY} is damaged: {getattr(error, 'strerror', None) or error}"
    except (KeyError, TypeError, AttributeError):
        fault = f"{SUMMARY} does not state the run's files: another version of surgsim wrote it"
    if fault:
        raise RecordingError(f"{folder}: {fault}")


def _content(file: Path) -> dict[str, Any]:
    with file.open("rb") as stream:
        digest = hashlib.file_digest(stream, "sha256").hexdigest()
        return {"bytes": os.fstat(stream.fileno()).st_size, "sha256": digest}
