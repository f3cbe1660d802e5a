"""A run's folder: `scenario.yaml`, `metrics.json` and `recording.rrd`, renamed into place when whole."""

import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from time import perf_counter
from typing import Any

from surgsim.errors import SurgsimError
from surgsim.metrics.catalog import compute_metrics
from surgsim.recording.sealed import sealed
from surgsim.runs.provenance import provenance
from surgsim.scenario.schema import Scenario
from surgsim.scenario.yaml_text import dump_yaml
from surgsim.simulate.loop import Progress, simulate
from surgsim.trace.trace import Trace

SCHEMA_VERSION = 1
RUN_FILES = frozenset({"scenario.yaml", "metrics.json", "recording.rrd"})


@dataclass(frozen=True, kw_only=True)
class RunResult:
    """A finished run.

    Attributes:
        trace: Its trace.
        metrics: Its metrics; None where a metric is not defined.
        wall_time_s: Wall time of the simulation alone [s].
    """

    trace: Trace
    metrics: Mapping[str, float | None]
    wall_time_s: float

    @property
    def real_time_factor(self) -> float:
        """Simulated time over wall time."""
        return float(self.trace["t_s"][-1]) / max(self.wall_time_s, 1e-9)


def run_to_folder(
    scenario: Scenario, folder: Path, *, record: bool = True, progress: Progress | None = None
) -> RunResult:
    """Run `scenario` and write its folder.

    Raises:
        SurgsimError: If the scenario cannot be started, or the folder cannot be written.
    """
    check_target(folder)
    result = execute(scenario, progress)
    write_run(scenario, result, folder, record=record)
    return result


def execute(scenario: Scenario, progress: Progress | None = None) -> RunResult:
    """Run `scenario` and compute its metrics; write nothing.

    Raises:
        SurgsimError: If the scenario cannot be started.
    """
    began = perf_counter()
    trace = simulate(scenario, progress)
    wall = perf_counter() - began
    return RunResult(trace=trace, metrics=compute_metrics(trace), wall_time_s=wall)


def write_run(
    scenario: Scenario, result: RunResult, folder: Path, *, record: bool, operator_input: str | None = None
) -> None:
    """Write a run's folder; `operator_input` is the record of a person's input, if one operated.

    Raises:
        SurgsimError: If the folder cannot be written.
    """
    with whole_folder(folder) as draft:
        outcome = result.trace.meta.ending.to_dict()
        summary = summary_of(scenario, outcome, result.metrics, result.wall_time_s)
        if operator_input is not None:
            summary["provenance"]["operator_input_sha256"] = sha256(operator_input.encode()).hexdigest()
            (draft / "operator_input.csv").write_text(operator_input)
        write_summary(draft, scenario, summary)
        if record:
            from surgsim.recording.write import write_recording  # rerun takes a second to import

            write_recording(draft / "recording.rrd", result.trace, result.metrics)


def write_summary(draft: Path, scenario: Scenario, summary: Mapping[str, Any]) -> None:
    """Write `scenario.yaml` and `metrics.json` into a folder that is being made."""
    (draft / "scenario.yaml").write_text(dump_yaml(scenario.resolved()))
    (draft / "metrics.json").write_text(json.dumps(sealed(summary), indent=2) + "\n")


def check_target(folder: Path) -> None:
    """Refuse a target that holds something other than a run.

    Raises:
        SurgsimError: If it does.
    """
    if folder.exists() and not folder.is_dir():
        raise SurgsimError(f"{folder} is a file; --out names a folder")
    foreign = {path.name for path in folder.iterdir()} - RUN_FILES if folder.is_dir() else set()
    if foreign:
        raise SurgsimError(f"{folder} holds '{min(foreign)}', which is not a run's; choose another --out")


@contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """A temporary sibling to write into; it takes the place of `folder` when the block ends well.

    Raises:
        SurgsimError: If the disk refuses.
    """
    draft: Path | None = None
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        draft = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", suffix=".part", dir=folder.parent))
        draft.chmod(0o755)
        yield draft
        if folder.exists():
            old = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", suffix=".old", dir=folder.parent))
            os.rename(folder, old / folder.name)
            os.rename(draft, folder)
            shutil.rmtree(old)
        else:
            os.rename(draft, folder)
    except OSError as error:
        raise SurgsimError(f"cannot write {folder}: {error.strerror or error}") from error
    finally:
        if draft is not None and draft.exists():
            shutil.rmtree(draft, ignore_errors=True)


def summary_of(
    scenario: Scenario, outcome: Mapping[str, Any], metrics: Mapping[str, float | None], wall_s: float
) -> dict[str, Any]:
    """The content of `metrics.json`."""
    return {
        "schema_version": SCHEMA_VERSION,
        "scenario": scenario.name,
        "controller": scenario.controller.name,
        "seed": scenario.seed,
        "outcome": dict(outcome),
        "metrics": dict(metrics),
        "provenance": {**provenance(), "scenario_sha256": scenario.sha256(), "wall_time_s": round(wall_s, 6)},
    }
