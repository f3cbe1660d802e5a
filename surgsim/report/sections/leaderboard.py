"""The leaderboard: every metric of every controller, sortable."""

from collections.abc import Mapping, Sequence

from surgsim.compare.intervals import Interval
from surgsim.compare.leaderboard import LeaderboardRow, leaderboard
from surgsim.compare.wording import bracket, counted, number
from surgsim.metrics.catalog import METRICS
from surgsim.report import html
from surgsim.report.results import Results

Boards = Mapping[str, Mapping[str, LeaderboardRow]]
"""Rows by metric and controller."""


def boards_of(results: Results) -> dict[str, dict[str, LeaderboardRow]]:
    """Leaderboards of all metrics."""
    return {
        name: {
            row.controller: row for row in leaderboard(results.runs, name, places=name == results.headline[0])
        }
        for name in results.metrics
    }


def leaderboard_section(results: Results, boards: Boards) -> str:
    """The sortable table. Without a completed run it says so."""
    if not boards:
        return html.section("leaderboard", "Leaderboard", html.paragraph("No run completed."))
    main = results.headline[0]
    names = list(boards[main])  # in order of mean rank
    best = {metric: _best(metric, boards[metric]) for metric in results.metrics}
    rows = []
    for name in names:
        row = boards[main][name]
        index = results.runs.controllers.index(name)
        cells = [
            f'<th scope="row">{html.swatch(index)}{html.breakable(name)}</th>',
            _failed(row),
            _rank(row.rank),
        ]
        cells += [
            _value(boards[metric][name], best[metric] == name, _extra(metric, results))
            for metric in _ordered(results)
        ]
        rows.append(cells)
    note = (
        "Press a heading to sort by it, best first; press again to reverse. Figures are interquartile means "
        "over completed runs with 95 % intervals below; read them beside the failures, which are in no mean. "
        "Bold: the best of the controllers that never failed. Mean rank: by "
        f"{main}, over scenarios, failures last."
    )
    points = len(set(results.runs.parameters.tolist()))
    if points > 1:
        note += f" All {points} points of the grid are pooled here; the sections below tell them apart."
    board = html.table("Leaderboard", _head(results, main), rows, "board")
    return html.section("leaderboard", "Leaderboard", html.paragraph(note), board, _PRINTED, _LIVE)


_PRINTED = '<p class="printed">Printed: the main metrics. All of them are in runs.csv.</p>'
_LIVE = '<p class="unseen" id="sorted" aria-live="polite"></p>'


def _ordered(results: Results) -> list[str]:
    """Metrics with those of the headline first."""
    return [*results.headline, *(name for name in results.metrics if name not in results.headline)]


def _head(results: Results, main: str) -> list[str]:
    """Headings with buttons; the table is sorted by mean rank to begin with."""
    cells = [
        _heading("controller", "", "text", "ascending", ""),
        _heading("failed", "of all runs", "number", "ascending", ""),
        _heading("mean rank", main, "number", "ascending", "", sort="ascending"),
    ]
    for name in _ordered(results):
        metric = METRICS[name]
        first = "descending" if metric.lower_is_better is False else "ascending"
        better = {True: "less is better", False: "more is better", None: ""}[metric.lower_is_better]
        title = f"{metric.meaning}; {better}".removesuffix("; ")
        cells.append(_heading(name, better, "number", first, _extra(name, results), title=title))
    return cells


def _heading(
    name: str, below: str, kind: str, first: str, extra: str, *, title: str = "", sort: str = "none"
) -> str:
    small = f"<small>{html.escape(below)}</small>" if below else ""
    words = html.breakable(name)
    return (
        f'<th scope="col" aria-sort="{sort}" class="{extra}"><button type="button" data-kind="{kind}" '
        f'data-first="{first}" data-name="{html.escape(name)}" title="{html.escape(title)}">{words}{small}'
        "</button></th>"
    )


def _extra(metric: str, results: Results) -> str:
    """Class of a column that paper has no room for."""
    return "" if metric in results.headline else "extra"


def _failed(row: LeaderboardRow) -> str:
    detail = f"<small>{html.escape(counted(row.failures))}</small>" if row.failed else ""
    classes = ' class="bad"' if row.failed else ""
    return f'<td data-value="{row.failed / row.runs:.6g}"{classes}>{row.failed} of {row.runs}{detail}</td>'


def _rank(rank: Interval) -> str:
    value = "" if rank.value is None else f"{rank.value:.6g}"
    return f'<td data-value="{value}">{number(rank.value)}{_below(rank)}</td>'


def _value(row: LeaderboardRow, best: bool, extra: str) -> str:
    value = "" if row.value.value is None else f"{row.value.value:.9g}"
    text = f"<b>{number(row.value.value)}</b>" if best else number(row.value.value)
    missing = (
        f"<small>{row.undefined} undefined</small>" if row.undefined and row.value.value is not None else ""
    )
    return f'<td class="{extra}" data-value="{value}">{text}{_below(row.value)}{missing}</td>'


def _below(interval: Interval) -> str:
    """The interval in small, or why there is none."""
    if interval.value is None:
        return ""
    reason = interval.note.removesuffix(": no interval").replace(
        "every seed gives the same", "same for all seeds"
    )
    return f"<small>{bracket(interval) or html.escape(reason)}</small>"


def _best(metric: str, rows: Mapping[str, LeaderboardRow]) -> str | None:
    """The controller with the best figure among those that never failed, if one stands out."""
    lower = METRICS[metric].lower_is_better
    values = {
        name: row.value.value for name, row in rows.items() if not row.failed and row.value.value is not None
    }
    if lower is None or len(set(values.values())) < 2:
        return None
    return min(values, key=lambda name: values[name] if lower else -values[name])


def metric_label(name: str) -> str:
    """Heading of a metric: words and unit."""
    return METRICS[name].heading


def failures_section(results: Results) -> str:
    """Outcomes of every controller in every scenario."""
    runs = results.runs
    if bool(runs.completed.all()):
        text = html.paragraph(f"None: all {len(runs)} runs completed.")
        return html.section("failures", "Failures", text)
    outcomes = sorted(set(runs.outcome[~runs.completed].tolist()))
    rows: list[Sequence[str]] = []
    for index, name in enumerate(runs.controllers):
        mine = runs.of_controller(name)
        counts = [int((mine.outcome == outcome).sum()) for outcome in outcomes]
        cells = [f'<td class="{"bad" if count else "zero"}">{count}</td>' for count in counts]
        label = f'<th scope="row">{html.swatch(index)}{html.breakable(name)}</th>'
        rows.append([label, f"<td>{len(mine)}</td>", f"<td>{int(mine.completed.sum())}</td>", *cells])
    head = ["controller", "runs", "completed", *(html.escape(outcome) for outcome in outcomes)]
    note = html.paragraph("A failed run is never averaged in and never dropped: it is counted here.")
    return html.section("failures", "Failures", note, html.table("Failures", head, rows))
