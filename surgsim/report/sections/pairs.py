"""Every controller against every other, in words."""

from surgsim.compare.intervals import Interval
from surgsim.compare.statistics import Comparison, compare_all
from surgsim.compare.verdict import Verdict
from surgsim.compare.wording import bracket, counted, number, seeds_of
from surgsim.metrics.catalog import METRICS
from surgsim.report import html
from surgsim.report.results import Results

_MOST_CONTROLLERS = 12


def pairs_section(results: Results) -> str:
    """Comparisons over all scenarios, one table for each headline metric."""
    if len(results.runs.controllers) < 2 or not results.metrics:
        return ""
    note = (
        "Runs are paired by scenario, grid point and seed; a pair counts where both completed. Scenarios "
        "weigh the same. The probability that A is better counts failures as losses. Each interval is 95 % "
        "by itself: of twenty comparisons without a difference one is expected to show one."
    )
    tables = []
    for k, metric in enumerate(results.headline):
        whole = comparison_table(results, metric)
        title = f"{metric}, all scenarios"
        tables.append(f"<h3>{html.escape(title)}</h3>{whole}" if k == 0 else html.details(title, whole))
    return html.section("pairs", "In pairs", html.paragraph(note), *tables)


def comparison_table(results: Results, metric: str, scenario: str | None = None) -> str:
    """Comparisons by one metric; of many controllers only the first ones."""
    found = compare_all(results.runs, metric, scenario, most=_MOST_CONTROLLERS)
    unit = METRICS[metric].heading.partition(" [")[2]
    unit = f" [{unit}" if unit else ""
    head = ["A against B", "finding", f"A − B{unit}", "P(A better)", "pairs", "left out"]
    cut = len(results.runs.controllers) > _MOST_CONTROLLERS
    note = f"The first {_MOST_CONTROLLERS} controllers only." if cut else ""
    table = html.table(f"Pairs by {metric}", head, [_row(comparison) for comparison in found], "pairs")
    return table + (html.paragraph(note) if note else "")


def _row(found: Comparison) -> list[str]:
    left = counted(found.left_out)
    kind = {Verdict.BETTER: "better", Verdict.WORSE: "worse"}.get(found.verdict, "open")
    return [
        f'<th scope="row">{html.breakable(found.a)}<small>against {html.breakable(found.b)}</small></th>',
        f'<td class="{kind}">{html.escape(found.sentence)}</td>',
        _figure(found.difference),
        _figure(found.improvement),
        f"{found.pairs}<small>{html.escape(seeds_of(found.seeds))}</small>",
        f"{sum(found.left_out.values())}<small>{html.escape(left)}</small>" if left else "0",
    ]


def _figure(interval: Interval) -> str:
    small = bracket(interval) or interval.note.removesuffix(": no interval")
    return f"{number(interval.value)}<small>{html.escape(small)}</small>"
