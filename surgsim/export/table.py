"""Tables for papers: a row for each controller of a batch, for each run, for each metric of a run."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from surgsim.compare.figure_text import bracket, heading_of, number
from surgsim.compare.leaderboard import LeaderboardRow, leaderboard
from surgsim.compare.observations import Observations
from surgsim.errors import SurgsimError, unknown_name
from surgsim.export.paper_table import WRITERS, PaperColumn, PaperTable
from surgsim.export.study_figure import keys_of
from surgsim.export.subjects import BatchSubject, RunSubject, StudySubject, Subject, arm_by_arm, check_metrics
from surgsim.export.target import write_whole
from surgsim.metrics.catalog import METRICS
from surgsim.studies.tables import Cell, format_cell

SUFFIXES = tuple(WRITERS)
DEFAULT_METRICS = ("rcm_error_rms_mm", "rcm_error_max_mm", "tip_error_rms_mm", "tip_error_max_mm")
"""Of several runs; a batch shows the first two that its page ranks by."""

_MOST_OF_A_BATCH = 2
_NOTE = (
    "IQM: interquartile mean over the completed runs of all scenarios, with its 95 % bootstrap interval "
    "where seeds allow one. Median and 95th percentile (P95) are of the same runs. Controllers that are not "
    "told apart share a place."
)


def write_table(
    path: Path, subjects: Sequence[Subject], metrics: Sequence[str] = (), study_table: str | None = None
) -> None:
    """Write the table of some runs, of a batch or of a study.

    Args:
        path: `.tex`, `.md` or `.csv`.
        subjects: Runs; or one batch or study.
        metrics: Names of the metrics to show; by default those of `DEFAULT_METRICS` that there are. Of a
            study: columns; all by default.
        study_table: Which table of a study; None: the main one.

    Raises:
        SurgsimError: If the subjects make no table, a metric is unknown, or the disk refuses.
    """
    write_whole(path, WRITERS[path.suffix.lower()](table_of(subjects, metrics, study_table)))


def table_of(
    subjects: Sequence[Subject], metrics: Sequence[str] = (), study_table: str | None = None
) -> PaperTable:
    """The table, see `write_table`."""
    check_metrics(subjects, metrics)
    subjects = arm_by_arm(subjects)
    runs = [subject for subject in subjects if isinstance(subject, RunSubject)]
    if len(runs) == len(subjects):
        return _run_table(runs[0], metrics) if len(runs) == 1 else _runs_table(runs, metrics)
    if len(subjects) != 1:
        raise SurgsimError("--table is of runs, or of one batch or one study: give these alone")
    (subject,) = subjects
    if isinstance(subject, BatchSubject):
        return batch_table(subject, metrics)
    assert isinstance(subject, StudySubject)
    return _study_table(subject, study_table, metrics)


def batch_table(batch: BatchSubject, metrics: Sequence[str] = ()) -> PaperTable:
    """A row for each controller in the order of the leaderboard of the first metric, failures beside it."""
    runs = batch.results.runs
    shown = list(metrics) or batch.results.headline[:_MOST_OF_A_BATCH]
    if not shown:
        raise SurgsimError(
            f"{batch.path}: no run completed: there is no metric to show; name one by --metric"
        )
    rows = leaderboard(runs, shown[0])
    columns = _standing(rows)
    for index, metric in enumerate(shown):
        by_name = {row.controller: row for row in leaderboard(runs, metric, places=False)} if index else {}
        ordered = [by_name.get(row.controller, row) for row in rows]
        columns += _spread(runs, metric, ordered)
    return PaperTable(columns=columns, note=_NOTE)


def _standing(rows: Sequence[LeaderboardRow]) -> list[PaperColumn]:
    """Who, at which place, with how many runs and failures."""
    names = [row.controller for row in rows]
    places = [row.place for row in rows]
    counts = {"failed": [row.failed for row in rows], "not_done": [row.not_done for row in rows]}
    return [
        PaperColumn(heading="controller", texts=names, cells={"controller": names}, right=False),
        PaperColumn(heading="place", texts=[str(place or "–") for place in places], cells={"place": places}),
        PaperColumn(
            heading="runs", texts=[str(row.runs) for row in rows], cells={"runs": [row.runs for row in rows]}
        ),
        PaperColumn(heading="failed", texts=[row.failed_words for row in rows], cells=counts, right=False),
    ]


def _spread(runs: Observations, metric: str, rows: Sequence[LeaderboardRow]) -> list[PaperColumn]:
    """Interquartile mean with its interval, median and 95th percentile of a metric."""
    heading = METRICS[metric].heading
    figures = [row.value for row in rows]
    iqm = PaperColumn(
        heading="IQM [95 %]",
        group=heading,
        texts=[f"{number(figure.value)} {bracket(figure)}".strip() for figure in figures],
        cells={
            f"{metric}_iqm": [figure.value for figure in figures],
            f"{metric}_iqm_low": [figure.low for figure in figures],
            f"{metric}_iqm_high": [figure.high for figure in figures],
        },
    )
    values = [runs.of_controller(row.controller).values(metric) for row in rows]
    finite = [each[np.isfinite(each)] for each in values]
    found = [iqm]
    for share, words, ending in ((50, "median", "median"), (95, "P95", "p95")):
        cells = [float(np.percentile(each, share)) if each.size else None for each in finite]
        texts = [number(cell) for cell in cells]
        found.append(
            PaperColumn(heading=words, group=heading, texts=texts, cells={f"{metric}_{ending}": cells})
        )
    return found


def _run_table(run: RunSubject, metrics: Sequence[str]) -> PaperTable:
    """A row for each metric that the run defines."""
    values = run.metrics
    names = [name for name in metrics or METRICS if metrics or values.get(name) is not None]
    parts = [heading_of(METRICS[name]) for name in names]
    cells = [values.get(name) for name in names]
    words, units = [part[0] for part in parts], [part[1] for part in parts]
    shown = [number(cell, METRICS[name].digits) for name, cell in zip(names, cells, strict=True)]
    return PaperTable(
        columns=[
            PaperColumn(heading="metric", texts=words, cells={"metric": names}, right=False),
            PaperColumn(heading="value", texts=shown, cells={"value": cells}),
            PaperColumn(
                heading="unit", texts=units, cells={"unit": [unit or "1" for unit in units]}, right=False
            ),
        ],
        note=f"{run.label}: {run.outcome.replace('_', ' ')}.",
    )


def _runs_table(runs: Sequence[RunSubject], metrics: Sequence[str]) -> PaperTable:
    """A row for each run."""
    shown = list(metrics) or [
        name for name in DEFAULT_METRICS if any(run.metrics.get(name) is not None for run in runs)
    ]
    words: list[tuple[str, Callable[[RunSubject], str | int], bool]] = [
        ("scenario", lambda run: run.named[0], False),
        ("controller", lambda run: run.named[1], False),
        ("seed", lambda run: run.named[2], True),
        ("outcome", lambda run: run.outcome, False),
    ]
    columns = []
    for name, cell, right in words:
        cells = [cell(run) for run in runs]
        texts = [str(one).replace("_", " ") if name == "outcome" else str(one) for one in cells]
        columns.append(PaperColumn(heading=name, texts=texts, cells={name: cells}, right=right))
    for name in shown:
        values = [run.metrics.get(name) for run in runs]
        texts = [number(value, METRICS[name].digits) for value in values]
        columns.append(PaperColumn(heading=METRICS[name].heading, texts=texts, cells={name: values}))
    return PaperTable(columns=columns)


def _study_table(study: StudySubject, table: str | None, chosen: Sequence[str]) -> PaperTable:
    """A table of a study, formatted as on its page."""
    _, rows = study.rows(table)
    for name in chosen:
        if name not in rows[0]:
            raise SurgsimError(f"--metric: {unknown_name(name, 'column of this table', list(rows[0]))}")
    columns = []
    for key in dict.fromkeys((*keys_of(rows), *chosen)) if chosen else rows[0]:
        cells: list[Cell] = [row[key] for row in rows]
        texts = [_signed(cell, format_cell(cell, column=key)) for cell in cells]
        right = all(isinstance(cell, int | float | None) for cell in cells)
        columns.append(
            PaperColumn(heading=key.replace("_", " "), texts=texts, cells={key: cells}, right=right)
        )
    return PaperTable(columns=columns)


def _signed(cell: Cell, text: str) -> str:
    """The text of a number with a minus sign instead of a hyphen."""
    return text.replace("-", "−", 1) if isinstance(cell, int | float) and cell < 0 else text
