"""Runs cases, in two processes if there are many; the results do not depend on how."""

import multiprocessing
import os
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

from surgsim.simulate.loop import simulate
from surgsim.studies.passive_teleoperation.cases import PAPER_DELAY_MS, Case, Shipped
from surgsim.studies.passive_teleoperation.measures import push_row, shipped_row
from surgsim.studies.passive_teleoperation.series import Series, series
from surgsim.studies.study import Progress, Row


@dataclass(frozen=True, kw_only=True)
class Done:
    """A case that was run.

    Attributes:
        case: The case.
        row: Its row of a table.
        curves: What the figures show of it; None for the cells of the sweep that they do not show.
    """

    case: Case
    row: Row
    curves: Series | None


def run_case(case: Case) -> Done:
    """Run a case."""
    trace = simulate(case.scenario())
    if isinstance(case, Shipped):
        return Done(case=case, row=shipped_row(case, trace), curves=series(trace))
    shown = case.delay_ms == PAPER_DELAY_MS and case.link == "clean"
    return Done(case=case, row=push_row(case, trace), curves=series(trace) if shown else None)


def run_cases(cases: Sequence[Case], workers: int, progress: Progress) -> list[Done]:
    """Every case, in order; `progress` says when each is done."""
    workers = min(workers, os.cpu_count() or 1)
    if workers < 2:
        return [_said(run_case(case), i, len(cases), progress) for i, case in enumerate(cases)]
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context) as pool:
        found = pool.map(run_case, cases)
        return [_said(done, i, len(cases), progress) for i, done in enumerate(found)]


def _said(done: Done, index: int, count: int, progress: Progress) -> Done:
    progress(f"{index + 1} of {count}: {done.case.label}")
    return done
