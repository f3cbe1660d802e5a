"""Runs a study: cases in several processes, then tables, claims, figures and the page."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path

from surgsim.packages import require
from surgsim.resources import cores
from surgsim.studies.figure import figure
from surgsim.studies.kept import read_measured, write_measured
from surgsim.studies.page import write_page
from surgsim.studies.processes import in_processes
from surgsim.studies.study import Case, Figure, Finding, Measured, Progress, Results, Study
from surgsim.studies.tables import Tables, write_csv

WORKERS = 8
"""At most so many processes, and no more than there are cores."""


@dataclass(frozen=True, kw_only=True)
class StudyResult:
    """What a study found.

    Attributes:
        claims: Every claim that was checked.
        tables: Name of each table to its rows; the first one is the main table.
        files: Names of the files written, in the order in which to read them.
    """

    claims: tuple[Finding, ...]
    tables: Tables
    files: tuple[str, ...]


def run_study(
    study: Study, out: Path, quick: bool, progress: Progress, kept: Path | None = None
) -> StudyResult:
    """Run a study and write its tables, figures and README.md into the existing folder `out`.

    Args:
        study: The declaration.
        out: The folder.
        quick: Whether to run the sample of the cases alone, and to draw nothing.
        progress: Told of what is done.
        kept: Folder for measured cases: those that it has are not run again. None keeps nothing.
    """
    if not quick:
        require("figures need", "matplotlib", otherwise="--quick")
    groups = study.cases(quick)
    cases = dict.fromkeys(case for group in groups.values() for case in group)
    results = Results(groups, measure_cases(cases, progress, kept=kept))
    tables = tables_of(study, results)
    findings = study.judge(tables)
    for name, rows in tables.items():
        write_csv(out / f"{name}.csv", rows)
    figures = () if quick else draw_figures(study.figures, results, tables, out, progress)
    write_page(out / "README.md", study, tables, findings, figures, quick=quick)
    files = ("README.md", *(f"{name}.csv" for name in tables), *figures)
    return StudyResult(claims=findings, tables=tables, files=files)


def tables_of(study: Study, results: Results) -> Tables:
    """The tables that have rows."""
    made = ((name, make(results)) for name, make in study.tables.items())
    return {name: rows for name, rows in made if rows}


def draw_figures(
    figures: Iterable[Figure], results: Results, tables: Tables, out: Path, progress: Progress
) -> tuple[str, ...]:
    """Draw the figures into the folder `out`; gives their files."""
    progress("figures")
    drawn = []
    for wanted in figures:
        sharex, sharey = wanted.share
        with figure(
            out / wanted.file, wanted.title, *wanted.shape, size=wanted.size, sharex=sharex, sharey=sharey
        ) as axes:
            wanted.draw(axes, results, tables)
        drawn.append(wanted.file)
    return tuple(drawn)


def measure_cases(
    cases: Iterable[Case], progress: Progress, workers: int | None = None, kept: Path | None = None
) -> Mapping[Case, Measured]:
    """Run and measure every case; the results do not depend on the number of processes.

    Args:
        cases: The cases; those that are `alone` are run last, in this process.
        progress: Told of each case when it is done.
        workers: Number of processes; by default the cores, up to `WORKERS`.
        kept: Folder of measured cases, see `run_study`.
    """
    wanted = list(cases)
    found = {case: old for case in wanted if kept and (old := read_measured(kept, case))}
    if found:
        progress(f"{len(found)} of {len(wanted)} cases are there from a run that was interrupted")
    missing = [case for case in wanted if case not in found]
    together, alone = ([case for case in missing if case.alone is flag] for flag in (False, True))
    processes = min(workers or min(cores(), WORKERS), len(together))
    measure = partial(_measure, kept)
    for measured in chain(in_processes(measure, together, processes), map(measure, alone)):
        found[measured.case] = measured
        progress(f"{len(found)} of {len(wanted)}: {measured.case.label}")
    return found


def _measure(kept: Path | None, case: Case) -> Measured:
    measured = case.measured()
    if kept is not None:
        write_measured(kept, measured)
    return measured
