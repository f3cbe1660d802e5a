"""Running a suite: what is whole is kept, what is missing is run, and the table is made at the end."""

import hashlib
import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from surgsim.compare.axis import AxisConfig
from surgsim.compare.columns import Table
from surgsim.compare.job import Job
from surgsim.compare.suite import RunSpec, SuiteConfig, check_runs, expand
from surgsim.compare.table import Row, open_again, write_table
from surgsim.compare.workers import Done, run_jobs
from surgsim.errors import SurgsimError
from surgsim.packages import RECORDING, require
from surgsim.recording.contents import fault_of
from surgsim.recording.files import replacing, write_file
from surgsim.recording.folders import make_folder
from surgsim.recording.sealed import read_sealed, sealed
from surgsim.runs.drafts import clear_drafts
from surgsim.runs.exchange import restore_all
from surgsim.runs.part_origins import check_parts
from surgsim.runs.provenance import code_difference, provenance, provenance_of
from surgsim.scenario.arms import Experiment

Report = Callable[[int, int, str], None]
"""Called with the runs that are done, all runs, and the last one's outcome."""
Runner = Callable[[Sequence[Job], int], Iterator[Done]]


@dataclass(frozen=True, kw_only=True)
class Batch:
    """A suite on its way.

    Attributes:
        suite: The suite.
        folder: What the suite's relative paths are relative to.
        out: Folder of its results.
        jobs: Worker processes.
        resume: Whether results that are there are kept.
        shard: This part of the runs, `(i, n)` with 1 <= i <= n.
        command: The command line, for the record.
    """

    suite: SuiteConfig
    folder: Path
    out: Path
    jobs: int = 1
    resume: bool = False
    shard: tuple[int, int] = (1, 1)
    command: str = ""


def compare(batch: Batch, report: Report | None = None, runner: Runner = run_jobs) -> Table | None:
    """Run what is missing of a suite, and write its table once every run is whole.

    Returns:
        The table, or None while other shards' runs are missing.

    Raises:
        SurgsimError: If the suite, a scenario or the results folder is not right, or the disk refuses.
    """
    specs = expand(batch.suite, batch.folder)
    scenarios = check_runs(specs)
    check_parts(scenarios)
    if any(spec.record for spec in specs):
        require("recordings need", *RECORDING, otherwise="leave the recordings out")
    rows = [_row(batch.suite, spec, scenario) for spec, scenario in zip(specs, scenarios, strict=True)]
    _check_names(rows)
    _prepare(batch)
    everything = list(zip(rows, scenarios, specs, strict=True))
    i, n = batch.shard
    ours = everything[i - 1 :: n]
    others: list[str] = []
    kept: set[str] = set()
    jobs = []
    for row, scenario, spec in ours:
        folder = batch.out / row.folder
        if _is_to_be_kept(folder, scenario, spec.record, others):
            kept.add(row.folder)
        else:
            jobs.append(Job(scenario_json=scenario.model_dump_json(), folder=str(folder), record=spec.record))
    count = len(ours)
    if others:
        told = f"{len(others)} of {count} runs were made by other code ({others[0]}) and are run again"
        print(f"surgsim: {told}", file=sys.stderr)
    if jobs:
        open_again(batch.out)
    for done, result in enumerate(runner(jobs, batch.jobs), start=count - len(jobs) + 1):
        if report is not None:
            report(done, count, result.outcome)
    rest = [(row, scenario, spec) for row, scenario, spec in everything if row.folder not in kept]
    if any(not is_whole(batch.out / row.folder, scenario, spec.record) for row, scenario, spec in rest):
        return None
    return write_table(batch.out, rows)


def _is_to_be_kept(folder: Path, scenario: Experiment, record: bool, others: list[str]) -> bool:
    """Whether `folder` holds the run, made by this code; if by other code, `others` gets the difference."""
    summary = _whole(folder, scenario, record)
    if summary is None:
        return False
    old, new = summary["provenance"], provenance_of(scenario)
    try:
        same = bool(old["code_sha256"] == new["code_sha256"])
        difference = "" if same else code_difference(old, new) or "of another version"
    except (KeyError, TypeError, AttributeError):
        same, difference = False, "of another version"
    if not same:
        others.append(difference)
    return same


def is_whole(folder: Path, scenario: Experiment, record: bool) -> bool:
    """Whether `folder` holds the run of exactly this scenario, with its recording if one is wanted.

    Every file of it must be as it was written.
    """
    return _whole(folder, scenario, record) is not None


def _whole(folder: Path, scenario: Experiment, record: bool) -> dict[str, Any] | None:
    """The summary of the run that `folder` holds, if it is whole."""
    try:
        summary = read_sealed(folder / "metrics.json")
        same = summary["provenance"]["scenario_sha256"] == scenario.sha256()
        recorded = not record or not summary["metrics"] or "recording.rrd" in summary["files"]
        return summary if same and recorded and not fault_of(folder, summary) else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _row(suite: SuiteConfig, spec: RunSpec, scenario: Experiment) -> Row:
    parameters: dict[str, Any] = dict(spec.parameters)
    point = "base"
    if parameters:
        text = json.dumps(parameters, sort_keys=True)
        point = hashlib.sha256(text.encode()).hexdigest()[:10]
    run_id = f"{scenario.name}/{scenario.controller_name}/{point}-seed{spec.seed}"
    return Row(run_id=run_id, suite=suite.name, parameters=parameters, folder=f"runs/{run_id}")


def _check_names(rows: Sequence[Row]) -> None:
    seen: set[str] = set()
    for row in rows:
        if row.run_id in seen:
            raise SurgsimError(
                f"two runs of the suite are both '{row.run_id}': "
                "give scenarios and controllers different names"
            )
        seen.add(row.run_id)


def _prepare(batch: Batch) -> None:
    """Make the results folder and write `suite.json`; clear away what killed runs left half done."""
    out, file = batch.out, batch.out / "suite.json"
    about = {
        "schema_version": 1,
        "name": batch.suite.name,
        "description": batch.suite.description,
        "scenarios": list(batch.suite.scenarios),
        "controllers": list(batch.suite.controllers or ()),
        "grid": {key: list(values) for key, values in batch.suite.grid.items()},
        "axes": _plain(batch.suite.axes),
        "sweeps": _plain(batch.suite.sweeps),
        "seeds": batch.suite.seeds,
        "settings": list(batch.suite.settings),
        "given": json.loads(batch.suite.given.model_dump_json()),
    }
    try:
        make_folder(out)
        if any(not path.name.startswith(_DRAFT) for path in out.iterdir()):
            _check_old(batch, about)
        _clear(out)
        told = {"matters": batch.suite.matters, "command": batch.command, "provenance": provenance()}
        whole = sealed({**about, **told})
        with replacing(file) as draft:
            write_file(draft, json.dumps(whole, indent=2) + "\n")
    except OSError as error:
        raise SurgsimError(f"cannot write {out}: {error.strerror or error}") from error


def _plain(axes: Mapping[str, AxisConfig]) -> dict[str, Any]:
    return {name: json.loads(axis.model_dump_json()) for name, axis in axes.items()}


_DRAFT = ".suite.json."


def _check_old(batch: Batch, about: Mapping[str, Any]) -> None:
    """Refuse a results folder that this batch may not go on with."""
    out = batch.out
    if not (out / "suite.json").is_file():
        raise SurgsimError(f"{out} holds files that are not batch results; choose another --out")
    if not batch.resume and batch.shard == (1, 1):
        raise SurgsimError(f"{out} holds results; give --resume to go on with them, or another --out")
    try:
        old = read_sealed(out / "suite.json")
        same = {key: old.get(key) for key in about} == about
    except ValueError as error:
        raise SurgsimError(f"{out / 'suite.json'} is damaged: {error}") from error
    if not same:
        raise SurgsimError(f"{out} holds the results of another suite, or of other settings")


def _clear(out: Path) -> None:
    """Remove what killed runs left half done; bring back what one had set aside."""
    for parent in out.glob("runs/*/*"):
        clear_drafts(parent)
        restore_all(parent)
