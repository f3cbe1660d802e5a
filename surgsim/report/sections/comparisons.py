"""Controllers against each other, in words: the first against every other, all pairs folded below."""

from collections.abc import Sequence

from surgsim.compare.figure_text import bracket, counted, exactly, heading_of, number, seeds_of
from surgsim.compare.intervals import Interval
from surgsim.compare.statistics import Comparison, compare_all, compare_pair
from surgsim.compare.verdict import Verdict
from surgsim.metrics.catalog import METRICS
from surgsim.report import html
from surgsim.report.results import Results
from surgsim.report.sections.leaderboard import Boards

_MOST_CONTROLLERS = 12


def pairs_section(results: Results, boards: Boards) -> str:
    """Comparisons over all scenarios: of the first controller, then of all, a table for each main metric."""
    if len(results.runs.controllers) < 2 or not boards:
        return ""
    note = (
        "Runs are paired by scenario, grid point and seed; a pair counts where both completed. Scenarios "
        "weigh the same. The probability that A is better counts failures as losses, and differences below "
        "what matters as half. Each interval is 95 % by itself: of twenty comparisons without a difference "
        "one is expected to show one."
    )
    main = results.headline[0]
    first, *others = boards[main]
    against = [compare_pair(results.runs, first, other, main) for other in others[: _MOST_CONTROLLERS - 1]]
    folded = [
        html.details(
            f"Every pair by {METRICS[metric].heading}",
            comparison_table(results, metric),
            printed=metric == main,
        )
        for metric in results.headline
    ]
    title = f"<h3>{html.escape(first)} against each, by {html.escape(METRICS[main].heading)}</h3>"
    return html.section(
        "pairs", "In pairs", html.paragraph(note), title, _table(results, main, against), *folded
    )


def comparison_table(results: Results, metric: str, scenario: str | None = None) -> str:
    """Comparisons by one metric; of many controllers only the first ones."""
    table = _table(results, metric, compare_all(results.runs, metric, scenario, most=_MOST_CONTROLLERS))
    cut = len(results.runs.controllers) > _MOST_CONTROLLERS
    return table + (html.paragraph(f"The first {_MOST_CONTROLLERS} controllers only.") if cut else "")


def _table(results: Results, metric: str, found: Sequence[Comparison]) -> str:
    unit = heading_of(METRICS[metric])[1]
    matters = results.runs.matters(metric)
    least = f"<small>{html.escape(exactly(matters, unit))} or more matters</small>" if matters else ""
    difference = f"A − B [{html.escape(unit)}]" if unit else "A − B"
    head = ["A against B", "finding", f"{difference}{least}", "P(A better)", "pairs", "left out"]
    return html.table(f"Pairs by {METRICS[metric].heading}", head, [_row(one) for one in found], "pairs")


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
