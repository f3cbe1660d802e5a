"""`surgsim.read`."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from surgsim.api.comparison import Comparison
from surgsim.api.run import Run, read_run
from surgsim.compare.unfinished import has_table
from surgsim.errors import RecordingError
from surgsim.recording.read import read_recording
from surgsim.trace.trace import Trace
from surgsim.verdict import judge, judge_each


def read(path: str | os.PathLike[str], /) -> "Run | Comparison":
    """Read what was written: a run's folder, a recording, or the results folder of a batch.

    Args:
        path: The folder, or the `.rrd` file.

    Returns:
        A `Run`, or a `Comparison` for a batch.

    Raises:
        SurgsimError: If it is none of these, not finished, or damaged.

    Example:
        >>> import surgsim, tempfile
        >>> out = tempfile.mkdtemp()
        >>> made = surgsim.run("circle_lwr4plus", task={"duration_s": 2.0}, out=out)
        >>> surgsim.read(out).trace.equals(made.trace)
        True
    """
    place = Path(path)
    if has_table(place) or (place / "suite.json").is_file():
        return Comparison.of_folder(place)
    if (place / "metrics.json").is_file():
        return read_run(place)
    if place.is_dir() and not (place / "recording.rrd").is_file():
        raise RecordingError(f"{place} holds neither a run nor a batch: no metrics.json, no runs.csv")
    recorded = read_recording(place)
    return Run(_summary(recorded.trace, recorded.metrics), trace=recorded.trace)


def _summary(trace: Trace, metrics: Mapping[str, float | None]) -> dict[str, Any]:
    """What a lone recording says of its run."""
    scenario = trace.meta.scenario
    each = {
        arm: {"controller": trace.of(arm).meta.controller, **verdict.to_dict()}
        for arm, verdict in judge_each(trace, metrics).items()
    }
    return {
        "scenario": scenario["name"],
        "controller": trace.meta.controller,
        "seed": scenario["seed"],
        "outcome": trace.meta.ending.to_dict(),
        **judge(trace, metrics).to_dict(),
        "metrics": dict(metrics),
        **({"arms": each} if each else {}),
        "provenance": {},
    }
