"""Reproduction of the manipulability paper: its tables and figures, and a bound it does not give."""

from itertools import product
from pathlib import Path

from surgsim.studies.manipulability_validation import paper
from surgsim.studies.manipulability_validation.claims import claims_of
from surgsim.studies.manipulability_validation.report import write_report
from surgsim.studies.manipulability_validation.runs import (
    PRINTED_NETWORKS,
    attainable,
    cells_of,
    run_cell,
    run_cells,
)
from surgsim.studies.manipulability_validation.setup import Cell
from surgsim.studies.manipulability_validation.tables import (
    Data,
    Sample,
    attainable_table,
    homes,
    networks,
    table_4,
    table_4_increase,
    table_5,
    variants,
)
from surgsim.studies.study import Progress, Row, StudyResult, write_study

QUICK_SAMPLE = (("circle", 3), ("sinusoid", 4))


def run(out: Path, quick: bool, progress: Progress) -> StudyResult:
    """Run the study and write its tables, figures and README.md into the existing folder `out`.

    Quick: two of the twelve cells, without variants and figures.
    """
    sample = QUICK_SAMPLE if quick else tuple(product(paper.PATHS, paper.HOMES))
    data = collect(sample, quick, progress)
    tables = tables_of(data, quick)
    claims = claims_of(tables)

    def draw_all() -> tuple[str, ...]:
        from surgsim.studies.manipulability_validation.figures import draw

        return draw(data, out)

    def report(page: Path, figures: tuple[str, ...]) -> None:
        write_report(page, tables, claims, figures, quick=quick)

    return write_study(out, tables, claims, None if quick else draw_all, report, progress)


def collect(sample: Sample, quick: bool, progress: Progress) -> Data:
    """Run everything that the tables need for the (path, home) pairs of `sample`."""
    cells = cells_of(("pinv", "rnn"), sample) + cells_of(("pinv", "self_motion"), sample, "smooth")
    if not quick:
        cells += cells_of(("pinv", "rnn"), sample, dh_variant="literal")
    traces = run_cells(cells, progress)
    upper = {}
    for path, home in sample:
        progress(f"{path}, home {home}: attainable manipulability")
        base, ours = (traces[cell] for cell in cells_of(("pinv", "self_motion"), [(path, home)], "smooth"))
        upper[path, home] = attainable((base, ours), ours)
    tried = () if quick else PRINTED_NETWORKS
    if tried:
        progress("circle, home 1: signs of eq. (7)")
    circle = Cell(path="circle", home=1, method="rnn")
    return Data(
        sample=sample, traces=traces, upper=upper, networks=[run_cell(circle, **keys) for keys in tried]
    )


def tables_of(data: Data, quick: bool) -> dict[str, list[Row]]:
    """The tables by name, the main one first."""
    tables = {
        "table_4": table_4(data),
        "table_4_increase": table_4_increase(data),
        "table_5": table_5(data),
        "attainable": attainable_table(data),
    }
    if not quick:
        tables |= {"variants": variants(data), "printed_network": networks(data), "homes": homes()}
    return tables
