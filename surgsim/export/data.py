"""The numbers of a run, a batch or a study for other tools."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surgsim.compare.figure_text import heading_of
from surgsim.errors import SurgsimError
from surgsim.export.columns import ENCODERS, Column
from surgsim.export.subjects import BatchSubject, RunSubject, StudySubject, Subject
from surgsim.export.target import write_whole
from surgsim.metrics.catalog import METRICS
from surgsim.recording.export import export
from surgsim.studies.tables import Row

SUFFIXES = tuple(ENCODERS)
_UNITS = {"outcome_t_s": "s", "wall_time_s": "s", "seed": "1", "success": "1"}


def write_data(path: Path, subjects: Sequence[Subject], study_table: str | None = None) -> None:
    """Write a run's control ticks, a batch's table of runs, or a table of a study.

    Args:
        path: `.mat`, `.npz` or `.parquet`.
        subjects: Just one.
        study_table: Which table of a study; None: the main one.

    Raises:
        SurgsimError: If there is more than one subject, a run was not recorded, or the disk refuses.
    """
    if len(subjects) != 1:
        raise SurgsimError("--data holds one run, one batch or one study: give one")
    (subject,), suffix = subjects, path.suffix.lower()
    if isinstance(subject, RunSubject) and suffix == ".parquet":
        export(subject.trace, path)
        return
    columns, about = _content(subject, study_table)
    write_whole(path, ENCODERS[suffix](columns, about))


def _content(subject: Subject, study_table: str | None) -> tuple[list[Column], str]:
    if isinstance(subject, RunSubject):
        return run_columns(subject), _about_run(subject)
    if isinstance(subject, BatchSubject):
        return batch_columns(subject), json.dumps(dict(subject.results.suite), sort_keys=True)
    return study_columns(subject, study_table)


def run_columns(run: RunSubject) -> list[Column]:
    """The columns of the trace, as they are.

    Raises:
        RecordingError: If the run was not recorded.
    """
    trace = run.trace
    units = [block.unit or "1" for block in trace.blocks for _ in block.columns]
    return [
        Column(name=name, values=trace[name], unit=unit)
        for name, unit in zip(trace.columns, units, strict=True)
    ]


def _about_run(run: RunSubject) -> str:
    """Scenario, limits, ending and metrics."""
    told = {**json.loads(run.trace.meta.to_json()), "metrics": dict(run.metrics)}
    return json.dumps(told, sort_keys=True)


def batch_columns(batch: BatchSubject) -> list[Column]:
    """The columns of the batch's table, a row for each run, failed ones included."""
    rows = batch.results.rows
    return [_of_cells(name, [row[name] for row in rows]) for name in rows[0]]


def study_columns(study: StudySubject, table: str | None) -> tuple[list[Column], str]:
    """The columns of a study's table, and which it is.

    Raises:
        SurgsimError: If there is no such table.
    """
    name, rows = study.rows(table)
    columns: list[Row] = rows
    told = json.dumps({"study": study.name, "table": name}, sort_keys=True)
    return [_of_cells(key, [row[key] for row in columns]) for key in columns[0]], told


def _of_cells(name: str, cells: Sequence[Any]) -> Column:
    """A column of cells of one kind; None is NaN among numbers and empty among texts."""
    texts = any(isinstance(cell, str) for cell in cells)
    metric = METRICS.get(name)
    if texts or (metric is None and all(cell is None for cell in cells)):
        told = np.array(["" if cell is None else str(cell) for cell in cells], dtype=object)
        return Column(name=name, values=told, unit="")
    values: NDArray[Any]
    if all(isinstance(cell, int) and not isinstance(cell, bool) for cell in cells):
        values = np.array(cells, dtype=np.int64)
    else:
        values = np.array([np.nan if cell is None else float(cell) for cell in cells])
    unit = (heading_of(metric)[1] if metric else _UNITS.get(name, "")) or "1"
    return Column(name=name, values=values, unit=unit, meaning=metric.meaning if metric else "")
