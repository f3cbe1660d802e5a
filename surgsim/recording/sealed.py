"""JSON files that carry their own checksum, so that a changed figure is noticed."""

import hashlib
import json
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Any

SEAL = "sha256"


def sealed(content: Mapping[str, Any]) -> dict[str, Any]:
    """`content` with the SHA-256 of all of it as its last key."""
    return {**content, SEAL: _digest(content)}


def read_sealed(path: Path) -> dict[str, Any]:
    """The content of a sealed file, without the seal.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If it holds no JSON object, or not what was written.
    """
    if not stat.S_ISREG(path.stat().st_mode):  # a pipe would block
        raise ValueError("it is not a file")
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error
    if not isinstance(content, dict):
        raise ValueError("it holds no object")
    found = content.pop(SEAL, None)
    if found is None:
        raise ValueError(f"it has no {SEAL}: it is cut, or of another version")
    if found != _digest(content):
        raise ValueError(f"it does not hold what was written: its {SEAL} differs")
    return content


def _digest(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
