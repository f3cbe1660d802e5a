"""A run's folder: `scenario.yaml`, `metrics.json` and `recording.rrd`, put into place when whole."""

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any

from surgsim.compiled.watch import working_time
from surgsim.errors import SurgsimError
from surgsim.metrics.catalog import evaluate
from surgsim.packages import RECORDING, require
from surgsim.recording.contents import SUMMARY, contents_of
from surgsim.recording.files import write_file
from surgsim.recording.folders import make_folder, sync_tree
from surgsim.recording.sealed import sealed
from surgsim.runs.drafts import draft_of
from surgsim.runs.exchange import put_in_place, restore
from surgsim.runs.provenance import provenance_of
from surgsim.scenario.arms import ArmsScenario, Experiment
from surgsim.scenario.yaml_text import dump_yaml
from surgsim.simulate.loop import Progress, simulate
from surgsim.trace.trace import Trace
from surgsim.verdict import Verdict, judge, judge_each

SCHEMA_VERSION = 2
RUN_FILES = frozenset({"scenario.yaml", "metrics.json", "recording.rrd"})


@dataclass(frozen=True, kw_only=True)
class RunResult:
    """A finished run.

    Attributes:
        trace: Its trace.
        metrics: Its metrics; None where a metric is not defined.
        wall_time_s: Wall time of the simulation alone [s], without what compiling kernels took.
        undefined: Why, for each metric that could not be computed.
    """

    trace: Trace
    metrics: Mapping[str, float | None]
    wall_time_s: float
    undefined: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def verdict(self) -> Verdict:
        """Whether its task was done, and the thresholds that it is held against."""
        return judge(self.trace, self.metrics)

    @property
    def real_time_factor(self) -> float:
        """Simulated time over wall time."""
        return float(self.trace["t_s"][-1]) / max(self.wall_time_s, 1e-9)


def run_to_folder(
    scenario: Experiment, folder: Path, *, record: bool = True, progress: Progress | None = None
) -> RunResult:
    """Run `scenario` and write its folder.

    A run that is there is replaced in one step: a reader finds the old run or the new one, at every moment.

    Raises:
        SurgsimError: If the scenario cannot be started, or the folder cannot be written.
    """
    check_target(folder)
    check_recordable(record)
    result = execute(scenario, progress)
    check_target(folder)  # it may have been filled meanwhile
    write_run(scenario, result, folder, record=record)
    return result


def check_recordable(record: bool, otherwise: str = "record=False") -> None:
    """Refuse to record where recordings cannot be written.

    Args:
        record: Whether it is to be recorded.
        otherwise: How the caller does without.

    Raises:
        MissingPackageError: With the package that is missing.
    """
    if record:
        require("recordings need", *RECORDING, otherwise=otherwise)


def execute(scenario: Experiment, progress: Progress | None = None) -> RunResult:
    """Run `scenario` and compute its metrics; write nothing.

    Raises:
        SurgsimError: If the scenario cannot be started.
    """
    began = working_time()
    trace = simulate(scenario, progress)
    return result_of(trace, working_time() - began)


def result_of(trace: Trace, wall_time_s: float) -> RunResult:
    """A finished run with its metrics; one that cannot be computed is None and has its reason."""
    found = evaluate(trace)
    return RunResult(trace=trace, metrics=found.values, wall_time_s=wall_time_s, undefined=found.undefined)


def write_run(
    scenario: Experiment, result: RunResult, folder: Path, *, record: bool, operator_input: str | None = None
) -> None:
    """Write a run's folder; `operator_input` is the record of a person's input, if one operated.

    Raises:
        SurgsimError: If the folder cannot be written.
    """
    with whole_folder(folder) as draft:
        summary = summary_of_result(scenario, result)
        if operator_input is not None:
            summary["provenance"]["operator_input_sha256"] = sha256(operator_input.encode()).hexdigest()
            write_file(draft / "operator_input.csv", operator_input)
        if record:
            from surgsim.recording.write import write_recording  # rerun takes a second to import

            write_recording(draft / "recording.rrd", result.trace, result.metrics)
        write_summary(draft, scenario, summary)


def write_summary(draft: Path, scenario: Experiment, summary: Mapping[str, Any]) -> None:
    """Write `scenario.yaml`, then `metrics.json` with size and hash of every file in the draft."""
    write_file(draft / "scenario.yaml", dump_yaml(scenario.resolved()))
    whole = sealed({**summary, "files": contents_of(draft)})
    write_file(draft / SUMMARY, json.dumps(whole, indent=2) + "\n")


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

    It does so in one step, and once all its files are on the disk. Any number of processes may write the same
    folder: the last one stays, whole.

    Raises:
        SurgsimError: If the disk refuses.
    """
    place = Path(os.path.realpath(folder))  # a link stays, and what it points to is replaced
    try:
        make_folder(place.parent)
        restore(place)
        with draft_of(place) as draft:
            with _named(draft, folder):
                yield draft
            sync_tree(draft)
            put_in_place(draft, place)
    except OSError as error:
        raise SurgsimError(f"cannot write {folder}: {error.strerror or error}") from error


@contextmanager
def _named(draft: Path, folder: Path) -> Iterator[None]:
    """Have errors name the folder that a person asked for, not the draft that is gone when they are read."""
    try:
        yield
    except SurgsimError as error:
        if str(draft) not in str(error):
            raise
        raise SurgsimError(str(error).replace(str(draft), str(folder))) from error


def summary_of_result(scenario: Experiment, result: RunResult) -> dict[str, Any]:
    """The content of `metrics.json` of a finished run."""
    outcome = result.trace.meta.ending.to_dict()
    each = judge_each(result.trace, result.metrics)
    return summary_of(
        scenario, outcome, result.verdict, result.metrics, result.wall_time_s, result.undefined, each
    )


def summary_of(
    scenario: Experiment,
    outcome: Mapping[str, Any],
    verdict: Verdict,
    metrics: Mapping[str, float | None],
    wall_s: float,
    undefined: Mapping[str, str] | None = None,
    each: Mapping[str, Verdict] | None = None,
) -> dict[str, Any]:
    """The content of `metrics.json`.

    Args:
        scenario: What was run.
        outcome: How it ended.
        verdict: Whether it was done.
        metrics: By name.
        wall_s: Wall time [s].
        undefined: Why, for each metric that could not be computed.
        each: The verdict on each of several arms; that on the run for those that have none.
    """
    arms = scenario.arms if isinstance(scenario, ArmsScenario) else ()
    of_arms = {
        arm.name: {"controller": arm.controller.name, **(each or {}).get(arm.name, verdict).to_dict()}
        for arm in arms
    }
    return {
        "schema_version": SCHEMA_VERSION,
        "scenario": scenario.name,
        "controller": scenario.controller_name,
        "seed": scenario.seed,
        "outcome": dict(outcome),
        **verdict.to_dict(),
        "metrics": dict(metrics),
        **({"arms": of_arms} if of_arms else {}),
        "undefined": dict(undefined or {}),
        "provenance": {**provenance_of(scenario), "wall_time_s": round(wall_s, 6)},
    }
