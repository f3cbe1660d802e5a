"""What is exported: a run, a batch or a study, found by a name or a path."""

import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from surgsim.compare.observations import metric_named
from surgsim.compare.unfinished import has_table
from surgsim.errors import RecordingError, SurgsimError, unknown_name
from surgsim.metrics.catalog import of_one_arm
from surgsim.recording.contents import check_contents
from surgsim.recording.layout import FILE_NAME
from surgsim.recording.read import Recorded, read_recording
from surgsim.recording.sealed import read_sealed
from surgsim.report.results import Results, read_results
from surgsim.studies import STUDIES, load_study
from surgsim.studies.tables import Cell, Row, read_csv
from surgsim.trace.trace import Trace

PLACES = ("runs", "runs/suites", "results")
"""Folders in which a name is looked for, where commands write by default."""

_MOST_NAMED = 5


@dataclass(frozen=True, kw_only=True, eq=False)
class RunSubject:
    """A run in a folder, or a lone recording.

    Attributes:
        path: The folder or the `.rrd` file.
        summary: What `metrics.json` holds; empty for a lone recording.
        arm: Which of several arms; empty: all.
    """

    path: Path
    summary: Mapping[str, Any]
    arm: str = ""

    @property
    def arms(self) -> tuple[str, ...]:
        """Names of its arms where there are several and it is of all of them."""
        if self.arm:
            return ()
        return tuple(self.summary.get("arms", ())) if self.summary else self.trace.arms

    @cached_property
    def recorded(self) -> Recorded:
        """The trace, and the metrics that were stored with it.

        Raises:
            RecordingError: If the run was not recorded, or the recording is damaged.
        """
        if self.path.is_dir() and not (self.path / FILE_NAME).is_file():
            again = f"surgsim run {shlex.quote(str(self.path / 'scenario.yaml'))} --out DIR"
            raise RecordingError(
                f"{self.path}: a run without recording: its metrics are there, its trace is not. "
                f"To record it: {again}"
            )
        found = read_recording(self.path)
        if not self.arm:
            return found
        return Recorded(trace=found.trace.of(self.arm), metrics=of_one_arm(found.metrics, self.arm))

    @property
    def trace(self) -> Trace:
        """Every control tick.

        Raises:
            RecordingError: As `recorded`.
        """
        return self.recorded.trace

    @property
    def metrics(self) -> Mapping[str, float | None]:
        """The metrics as stored."""
        found: Mapping[str, float | None] = self.summary.get("metrics", {})
        return (of_one_arm(found, self.arm) if self.arm else found) or self.recorded.metrics

    @cached_property
    def named(self) -> tuple[str, str, int]:
        """Scenario, controller and seed."""
        if self.summary:
            found, of = self.summary, self.summary["arms"][self.arm] if self.arm else self.summary
            name, controller, seed = found["scenario"], of["controller"], found["seed"]
        else:
            scenario = self.trace.meta.scenario
            name, controller, seed = scenario["name"], self.trace.meta.controller, scenario["seed"]
        return f"{name}.{self.arm}" if self.arm else str(name), str(controller), int(seed)

    @property
    def outcome(self) -> str:
        """How it ended: `completed`, `rcm_limit` and so on."""
        if self.summary:
            return str(self.summary["outcome"]["name"])
        return self.trace.meta.ending.outcome.name.lower()

    @property
    def label(self) -> str:
        """Scenario, controller and seed in words."""
        scenario, controller, seed = self.named
        return f"{scenario}, {controller}, seed {seed}"


@dataclass(frozen=True, kw_only=True, eq=False)
class BatchSubject:
    """The results of `surgsim compare`.

    Attributes:
        path: Their folder.
        results: Their table.
    """

    path: Path
    results: Results

    def run(self, run_id: str) -> RunSubject:
        """One of its runs.

        Raises:
            SurgsimError: If there is none of that id, or its folder is damaged.
        """
        folders = {row["run_id"]: row["folder"] for row in self.results.rows}
        if run_id not in folders:
            raise SurgsimError(unknown_name(run_id, f"run of {self.path}", list(folders)[:20]))
        whole = _run(self.path / folders[run_id])
        return replace(whole, arm=run_id.rpartition(".")[2]) if whole.arms else whole


@dataclass(frozen=True, kw_only=True, eq=False)
class StudySubject:
    """The folder that `surgsim reproduce` wrote.

    Attributes:
        path: The folder.
        name: The study.
        tables: Names of the tables that are there, the main one first.
    """

    path: Path
    name: str
    tables: tuple[str, ...]

    def rows(self, table: str | None) -> tuple[str, list[Row]]:
        """Name and rows of a table, the main one if none is named; numbers as numbers, empty cells None.

        Raises:
            SurgsimError: If there is no such table.
        """
        name = table or self.tables[0]
        if name not in self.tables:
            raise SurgsimError(f"--study-table: {unknown_name(name, f'table of {self.path}', self.tables)}")
        texts = read_csv(self.path / f"{name}.csv")
        kinds = {key: _kind([row[key] for row in texts]) for key in texts[0]}
        return name, [{key: kinds[key](text) if text else None for key, text in row.items()} for row in texts]


Subject = RunSubject | BatchSubject | StudySubject


def check_metrics(subjects: Sequence[Subject], metrics: Sequence[str]) -> None:
    """Refuse a metric that there is not; of a study the columns of its table are named.

    Raises:
        SurgsimError: Then.
    """
    if not any(isinstance(subject, StudySubject) for subject in subjects):
        for name in metrics:
            metric_named(name)


def find(name: str) -> Subject:
    """What a name or a path stands for.

    Args:
        name: A path, or what stands below one of `PLACES`: `circle_lwr4plus/vprnn-seed0`, `quick`, `vprnn`.

    Raises:
        SurgsimError: If it is nothing that can be exported, or it is damaged.
    """
    path = _located(name)
    if has_table(path) or (path / "suite.json").is_file():
        return BatchSubject(path=path, results=read_results(path))
    if (path / "metrics.json").is_file() or path.suffix == ".rrd" or (path / FILE_NAME).is_file():
        return _run(path)
    if study := _study_of(path):
        return study
    return _run(_only_run(path))


def arm_by_arm(subjects: Sequence[Subject]) -> list[Subject]:
    """The subjects, a run of several arms as one for each of them."""
    found: list[Subject] = []
    for subject in subjects:
        if isinstance(subject, RunSubject) and subject.arms:
            found += [replace(subject, arm=arm) for arm in subject.arms]
        else:
            found.append(subject)
    return found


def chosen(subjects: Sequence[Subject], run_ids: Sequence[str]) -> list[Subject]:
    """The runs of that id in place of the batch that holds them; everything as it is without ids.

    Raises:
        SurgsimError: If there is not just one batch to choose from.
    """
    if not run_ids:
        return list(subjects)
    batches = [subject for subject in subjects if isinstance(subject, BatchSubject)]
    if len(batches) != 1 or len(subjects) != 1:
        raise SurgsimError("--run names runs of one batch: give the folder of that alone")
    return [batches[0].run(run_id) for run_id in run_ids]


def _located(name: str) -> Path:
    """Where a name or path is."""
    if not name:
        raise SurgsimError("'' is not a path")
    places = [Path(name), *(Path(place) / name for place in PLACES)]
    for path in places:
        try:
            if path.exists():
                return path
        except (OSError, ValueError) as error:
            raise SurgsimError(f"{name[:200]}: cannot be used: {error}") from error
    looked = ", ".join(f"{place}/" for place in PLACES)
    raise SurgsimError(f"'{name}' is neither a path nor the name of a run, a batch or a study in {looked}")


def _run(path: Path) -> RunSubject:
    """The run in a folder, whole, or a lone recording."""
    if not (path / "metrics.json").is_file():
        return RunSubject(path=path, summary={})
    check_contents(path)
    try:
        return RunSubject(path=path, summary=read_sealed(path / "metrics.json"))
    except (OSError, ValueError) as error:
        raise RecordingError(f"{path}: metrics.json is damaged: {error}") from error


def _only_run(path: Path) -> Path:
    """The one run below a folder that is none itself."""
    if not path.is_dir():
        raise SurgsimError(f"{path} is neither a run, a batch nor a study, nor a recording (.rrd)")
    found = sorted(file.parent for file in path.glob("[!.]*/metrics.json"))
    if len(found) == 1:
        return found[0]
    if not found:
        raise SurgsimError(f"{path} holds neither a run, a batch nor a study")
    more = f" and {len(found) - _MOST_NAMED} more" if len(found) > _MOST_NAMED else ""
    named = ", ".join(map(str, found[:_MOST_NAMED]))
    raise SurgsimError(f"{path}: a folder of {len(found)} runs: {named}{more}. Name those that are meant.")


def _study_of(path: Path) -> StudySubject | None:
    """The study in a folder: its page names the command that made it."""
    page = path / "README.md"
    if not page.is_file():
        return None
    text = page.read_text(encoding="utf-8", errors="replace")
    for name in STUDIES:
        if f"surgsim reproduce {name}" in text:
            tables = [table for table in load_study(name).tables if (path / f"{table}.csv").is_file()]
            if tables:
                return StudySubject(path=path, name=name, tables=tuple(tables))
    return None


def _kind(texts: Sequence[str]) -> Callable[[str], Cell]:
    """What the cells of a study's column were before they became texts: whole numbers, numbers or texts."""
    for kind in (int, float):
        try:
            for text in filter(None, texts):
                kind(text)
        except ValueError:
            continue
        return kind
    return str
