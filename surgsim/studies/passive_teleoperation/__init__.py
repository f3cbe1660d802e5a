"""Reproduction of the passive convex teleoperation paper: claims, comparisons, the delay it bears."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from surgsim.studies.passive_teleoperation.cases import (
    PAPER_DELAY_MS,
    SHIPPED,
    Case,
    Push,
    Shipped,
    comparison,
    sweep,
)
from surgsim.studies.passive_teleoperation.claims import paper_claims
from surgsim.studies.passive_teleoperation.frontier import frontier_table
from surgsim.studies.passive_teleoperation.own_claims import own_claims
from surgsim.studies.passive_teleoperation.paper import beside_the_paper
from surgsim.studies.passive_teleoperation.report import write_report
from surgsim.studies.passive_teleoperation.runs import Done, run_cases
from surgsim.studies.passive_teleoperation.timing import timing_row
from surgsim.studies.study import Progress, Row, StudyResult, write_study
from surgsim.studies.vprnn.cells import pick

WORKERS = 2


@dataclass(frozen=True, kw_only=True)
class Extent:
    """Which cases are run.

    Attributes:
        shipped: Scenarios as shipped.
        pushes: Pushes with the passivity, grip, delay and channel varied.
        timed: Scenarios whose QP is timed.
    """

    shipped: tuple[Shipped, ...]
    pushes: tuple[Push, ...]
    timed: tuple[Shipped, ...]


FULL = Extent(
    shipped=tuple(Shipped(name=name) for name in SHIPPED),
    pushes=(*sweep(), *comparison("free")),
    timed=(Shipped(name="free motion"), Shipped(name="workspace limits")),
)
_FIRST_REACH = "task.goals=[{position_m: [0.02, 0.65, -0.03]}]"
_FIRST_WALL = "task.goals=[{position_m: [0.035, 0.65, -0.03], push: true, dwell_s: 0.5}]"
QUICK = Extent(
    shipped=(
        Shipped(name="free motion", keys=(_FIRST_REACH, "task.hold_end_s=0")),
        Shipped(name="workspace limits", keys=(_FIRST_WALL, "task.hold_end_s=0")),
    ),
    pushes=(
        Push(place="wall", passivity="tank", grip="normal", delay_ms=PAPER_DELAY_MS, cut_s=5.0),
        Push(place="wall", passivity="off", grip="light", delay_ms=PAPER_DELAY_MS, cut_s=5.0),
    ),
    timed=(),
)


@dataclass(frozen=True, kw_only=True)
class Data:
    """What was run.

    Attributes:
        tables: Name of each table to its rows, the main one first.
        shipped: The shipped scenarios with their curves.
        pushes: The pushes; those of the comparison with their curves.
    """

    tables: dict[str, Sequence[Row]]
    shipped: Sequence[Done]
    pushes: Sequence[Done]


def run(out: Path, quick: bool, progress: Progress) -> StudyResult:
    """Run the study and write its tables, figures and README.md into the existing folder `out`."""
    data = collect(QUICK if quick else FULL, progress)
    claims = (*paper_claims(data.tables), *own_claims(data.tables))
    draw = None if quick else partial(_draw, data, out)

    def report(page: Path, figures: tuple[str, ...]) -> None:
        write_report(page, data.tables, claims, figures, quick=quick)

    return write_study(out, data.tables, claims, draw, report, progress)


def collect(extent: Extent, progress: Progress) -> Data:
    """Run everything; the timing last, in this process alone."""
    cases: list[Case] = [*extent.shipped, *extent.pushes]
    done = run_cases(cases, WORKERS, progress)
    shipped, pushes = done[: len(extent.shipped)], done[len(extent.shipped) :]
    rows, scenarios = [case.row for case in pushes], [case.row for case in shipped]
    tables: dict[str, Sequence[Row]] = {
        "paper": beside_the_paper(scenarios),
        "scenarios": scenarios,
        "comparison": pick(rows, delay_ms=PAPER_DELAY_MS, link="clean"),
        "frontier": frontier_table(rows),
        "pushes": rows,
    }
    if extent.timed:
        progress("timing")
        tables["timing"] = [timing_row(case) for case in extent.timed]
    return Data(tables=tables, shipped=shipped, pushes=pushes)


def _draw(data: Data, out: Path) -> tuple[str, ...]:
    from surgsim.studies.passive_teleoperation.comparison_figures import draw_comparison, draw_sweep
    from surgsim.studies.passive_teleoperation.figures import draw_constraints, draw_tanks, draw_tracking

    draw_tracking(data.shipped, out / "tracking.png")
    draw_tanks(data.shipped, out / "tanks.png")
    draw_constraints(data.shipped, out / "constraints.png")
    draw_comparison(data.pushes, out / "comparison.png")
    draw_sweep(data.tables["pushes"], out / "sweep.png")
    return ("tracking.png", "tanks.png", "constraints.png", "comparison.png", "sweep.png")
