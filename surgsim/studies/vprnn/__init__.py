"""Reproduction of the VPRNN paper: figures 4 to 8, its claims, and what they depend on."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from surgsim.studies.study import Progress, Row, StudyResult, write_study
from surgsim.studies.vprnn.cases import METHODS, NOMINAL, PAPER_SIZE, Level
from surgsim.studies.vprnn.claims import paper_claims
from surgsim.studies.vprnn.comparison import VARIANTS, Runs, Variant, comparison_table, run_all, variant_table
from surgsim.studies.vprnn.disturbances import GRID, OURS, Cell, ladder_table
from surgsim.studies.vprnn.euler import CELLS, arm_table, euler_table
from surgsim.studies.vprnn.network import SEEDS as NETWORK_SEEDS
from surgsim.studies.vprnn.network import Instant, cross_form_rank, instant, rate_row, theorem_table
from surgsim.studies.vprnn.own_claims import own_claims
from surgsim.studies.vprnn.report import write_report
from surgsim.studies.vprnn.starts import SEEDS as START_SEEDS
from surgsim.studies.vprnn.starts import STARTED, Starts, run_starts, starts_table, summary_table


@dataclass(frozen=True, kw_only=True)
class Extent:
    """Which cells are run.

    Attributes:
        methods: Controllers of figures 4 to 8.
        variants: Gains that are tried.
        ladder: Controllers and disturbances.
        euler: Pairs of beta and period.
        plants: Plants on which explicit Euler is run.
        network_seeds: Random states of the networks.
        starts: Plant, spread and seeds of the random configurations.
    """

    methods: tuple[str, ...]
    variants: tuple[Variant, ...]
    ladder: tuple[Cell, ...]
    euler: tuple[tuple[float, float], ...]
    plants: tuple[str, ...]
    network_seeds: tuple[int, ...]
    starts: tuple[tuple[str, str, tuple[int, ...]], ...]


FULL = Extent(
    methods=tuple(METHODS),
    variants=VARIANTS,
    ladder=(*GRID, *OURS),
    euler=CELLS,
    plants=("kinematic", "dynamic"),
    network_seeds=NETWORK_SEEDS,
    starts=(
        ("kinematic", "near", START_SEEDS),
        ("dynamic", "near", START_SEEDS),
        ("dynamic", "far", START_SEEDS[:10]),
    ),
)
QUICK = Extent(
    methods=("nullspace", "rnn", "vprnn", "rcm_inverse_dynamics"),
    variants=tuple(variant for variant in VARIANTS if variant.quick),
    ladder=(
        ("vprnn", NOMINAL),
        ("vprnn", PAPER_SIZE),
        ("vprnn", Level(coulomb_nm=1.0)),
        ("rcm_inverse_dynamics", NOMINAL),
    ),
    euler=((1000.0, 1e-3),),
    plants=("kinematic",),
    network_seeds=(0,),
    starts=(("dynamic", "near", START_SEEDS[:1]),),
)


@dataclass(frozen=True, kw_only=True)
class Data:
    """What was run.

    Attributes:
        tables: Name of each table to its rows, the main one first.
        comparison: Traces of figures 4 to 8.
        starts: Traces of the random starts.
        at: The problem that the networks solve.
    """

    tables: dict[str, Sequence[Row]]
    comparison: Runs
    starts: Starts
    at: Instant


def run(out: Path, quick: bool, progress: Progress) -> StudyResult:
    """Run the study and write its tables, figures and README.md into the existing folder `out`."""
    data = collect(QUICK if quick else FULL, progress)
    claims = (*paper_claims(data.tables), *own_claims(data.tables))
    draw = None if quick else partial(_draw, data, out)

    def report(page: Path, figures: tuple[str, ...]) -> None:
        write_report(page, data.tables, claims, figures, cross_rank=cross_form_rank(data.at), quick=quick)

    return write_study(out, data.tables, claims, draw, report, progress)


def collect(extent: Extent, progress: Progress) -> Data:
    """Run everything."""
    comparison = run_all(extent.methods, (NOMINAL, PAPER_SIZE), progress)
    starts: Starts = {}
    for plant, spread, seeds in extent.starts:
        names = STARTED if plant == "dynamic" else STARTED[:3]
        starts |= run_starts(names, plant, spread, seeds, progress)
    every_start = starts_table(starts)
    progress("the networks alone")
    at = instant()
    tables: dict[str, Sequence[Row]] = {
        "comparison": comparison_table(comparison),
        "gains": variant_table(extent.variants, comparison, progress),
        "ladder": ladder_table(extent.ladder, comparison, progress),
        "network_rates": [rate_row(at, seed) for seed in extent.network_seeds],
        "theorem_1": theorem_table(at, extent.network_seeds),
        "euler": euler_table(at, extent.euler),
        "euler_arm": arm_table(extent.plants),
        "starts": summary_table(every_start),
        "starts_every_run": every_start,
    }
    return Data(tables=tables, comparison=comparison, starts=starts, at=at)


def _draw(data: Data, out: Path) -> tuple[str, ...]:
    from surgsim.studies.vprnn.convergence_figures import draw_euler, draw_networks, draw_starts
    from surgsim.studies.vprnn.error_figures import draw_gains, draw_ladder
    from surgsim.studies.vprnn.figures import draw_comparison

    drawn = draw_comparison(data.comparison, out)
    draw_gains(data.tables["gains"], out / "gains.png")
    draw_ladder(data.tables["ladder"], out / "ladder.png")
    draw_networks(data.at, out / "networks.png")
    draw_euler(data.at, out / "euler.png")
    draw_starts(data.starts, out / "starts.png")
    return (*drawn, "gains.png", "ladder.png", "networks.png", "euler.png", "starts.png")
