"""Reading a recording back: the trace bit for bit, or a clear refusal."""

import json
import os
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from surgsim.array import Array
from surgsim.errors import RecordingError
from surgsim.packages import RECORDING, require
from surgsim.recording.framing import check_framing, recording_file
from surgsim.recording.layout import Header
from surgsim.resources import run_module
from surgsim.trace.trace import Trace, base_blocks

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
        MissingPackageError: If rerun or pyarrow is not installed.
    """
    file = recording_file(Path(path))
    check_framing(file)
    require("recordings need", *RECORDING)
    texts, data = _parse(file, _extract(file))
    header = Header.from_texts(texts)
    if reason := _fault(header):
        raise RecordingError(f"{file}: damaged recording: {reason}")
    return Recorded(trace=Trace(data, header.blocks, header.meta), metrics=header.metrics)


def _fault(header: Header) -> str:
    """What every run has and this one has not, or nothing."""
    scenario = header.meta.scenario
    try:
        for arm in header.meta.arms or ("",):
            if missing := _missing(header, f"{arm}_" if arm else ""):
                return f"it has no column '{missing}'"
        named = isinstance(scenario["name"], str) and isinstance(header.meta.controller, str)
        return "" if named and isinstance(scenario["seed"], int) else "its scenario has no name or seed"
    except (KeyError, TypeError) as error:
        return f"its scenario is not whole: {error}"


def _missing(header: Header, first: str) -> str | None:
    """A column that every arm has, and the one whose columns begin with `first` has not."""
    found = {name for block in header.blocks for name in block.columns}
    joints = max((len(block.labels) for block in header.blocks if block.name == f"{first}q"), default=1)
    time, *others = base_blocks(joints)
    every = [*time.columns, *(first + name for block in others for name in block.columns)]
    return next((name for name in every if name not in found), None)


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
