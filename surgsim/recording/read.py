"""Reading a recording back: the trace bit for bit, or a clear refusal."""

import json
import os
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from surgsim.errors import RecordingError
from surgsim.recording.framing import check_framing, recording_file
from surgsim.recording.layout import Header
from surgsim.resources import run_module
from surgsim.trace.trace import Array, Trace, base_blocks

_TIMEOUT_S = 120.0


@dataclass(frozen=True, kw_only=True)
class Recorded:
    """What a recording holds.

    Attributes:
        trace: The run.
        metrics: Metrics that were stored with it; None where one does not apply.
    """

    trace: Trace
    metrics: Mapping[str, float | None]


def read_recording(path: str | os.PathLike[str]) -> Recorded:
    """Read a recording, or the one in a run's folder.

    Raises:
        RecordingError: If there is none, it is damaged or cut short, or surgsim did not write it.
    """
    file = recording_file(Path(path))
    check_framing(file)
    texts, data = _parse(file, _extract(file))
    header = Header.from_texts(texts)
    if reason := _fault(header):
        raise RecordingError(f"{file}: damaged recording: {reason}")
    return Recorded(trace=Trace(data, header.blocks, header.meta), metrics=header.metrics)


def _fault(header: Header) -> str:
    """What every run has and this one has not, or nothing."""
    found = {name for block in header.blocks for name in block.columns}
    joints = max((len(block.labels) for block in header.blocks if block.name == "q"), default=1)
    missing = [name for block in base_blocks(joints) for name in block.columns if name not in found]
    if missing:
        return f"it has no column '{missing[0]}'"
    scenario = header.meta.scenario
    try:
        named = isinstance(scenario["name"], str) and isinstance(scenario["controller"]["name"], str)
        return "" if named and isinstance(scenario["seed"], int) else "its scenario has no name or seed"
    except (KeyError, TypeError) as error:
        return f"its scenario is not whole: {error}"


def _extract(file: Path) -> bytes:
    """What `surgsim.recording.extract`, run as a program of its own, says of the file."""
    try:
        done = run_module("surgsim.recording.extract", str(file), timeout_s=_TIMEOUT_S)
    except subprocess.TimeoutExpired as error:
        raise RecordingError(f"{file}: damaged recording: not read after {_TIMEOUT_S:g} s") from error
    if done.returncode != 0:
        reason = done.stderr.decode(errors="replace")
        if "ModuleNotFoundError" in reason:
            raise RecordingError(f"{file}: cannot be read: {reason.strip().splitlines()[-1]}")
        raise RecordingError(f"{file}: damaged recording: rerun cannot read it")
    return done.stdout


def _parse(file: Path, answer: bytes) -> tuple[dict[str, str], Array]:
    """Texts of the header and columns (rows, columns)."""
    line, _, values = answer.partition(b"\n")
    found = json.loads(line)
    if "error" in found:
        raise RecordingError(found["error"])
    return found["texts"], np.frombuffer(values, dtype=np.float64).reshape(found["shape"])
