"""The leaderboard: places and main metrics of every controller, all other metrics folded below; sortable."""

from collections.abc import Mapping, Sequence

from surgsim.compare.failures import counted_outcomes, outcome_words
from surgsim.compare.figure_text import bracket, number
from surgsim.compare.intervals import Interval
from surgsim.compare.leaderboard import LeaderboardRow, leaderboard
from surgsim.metrics.catalog import METRICS
from surgsim.report import html
from surgsim.report.results import Results

Boards = Mapping[str, Mapping[str, LeaderboardRow]]
"""Rows by metric and controller."""


def boards_of(results: Results) -> dict[str, dict[str, LeaderboardRow]]:
    """Leaderboards of all metrics, with places by the first of the headline."""
    return {
        name: {
            row.controller: row for row in leaderboard(results.runs, name, places=name == results.headline[0])
        }
        for name in results.metrics
    }


def leaderboard_section(results: Results, boards: Boards) -> str:
    """The tables. Without a completed run it says so."""
    if not boards:
        return html.section("leaderboard", "Leaderboard", html.paragraph("No run completed."))
    main = results.headline[0]
    note = (
        f"Places and ranks are by {METRICS[main].heading}; in places, who fails more comes after, and "
        "controllers that are not told apart share one. Figures are interquartile means over completed runs "
        "with 95 % intervals below; failures are in no mean. Bold: the best of those that never failed, and "
        "what is not worse by what matters. Press a heading to sort, again to reverse."
    )
    points = len(set(results.runs.parameters.tolist()))
    if points > 1:
        note += f" All {points} points of the grid are pooled here; the sections below tell them apart."
    rest = [name for name in results.metrics if name not in results.headline]
    others = html.details(
        f"{len(rest)} more metrics",
        *(_board(results, boards, group, "board all", places=False) for group in html.groups(rest, _ABREAST)),
        small=", ".join(METRICS[name].heading.partition(" [")[0] for name in rest[:4]) + ", …",
    )
    table = _board(results, boards, results.headline, "board main", places=True)
    return html.section(
        "leaderboard", "Leaderboard", html.paragraph(note), table, others if rest else "", _PRINTED, _LIVE
    )


_ABREAST = 6
"""Columns of metrics beside each other that a sheet of paper has room for."""

_PRINTED = '<p class="printed">Printed: the main metrics. All of them are in runs.csv.</p>'
_LIVE = '<p class="unseen" id="sorted" aria-live="polite"></p>'


def _board(results: Results, boards: Boards, metrics: Sequence[str], classes: str, *, places: bool) -> str:
    """A table of `metrics`, in order of mean rank; with places, failures and ranks, or without."""
    main = boards[results.headline[0]]
    judged = bool((results.runs.success >= 0.0).any())
    best = {metric: _best(results, metric, boards[metric]) for metric in metrics}
    rows = []
    for name, row in main.items():
        swatch = html.swatch(results.runs.controllers.index(name))
        cells = [f'<th scope="row">{swatch}{html.breakable(name)}</th>']
        figures = [_value(boards[metric][name], name in best[metric]) for metric in metrics]
        if places:  # the main metric stays in sight on a phone
            counts = [_failed(row), *([_not_done(row)] if judged else []), _rank(row.rank)]
            figures = [_number(row.place), figures[0], *counts, *figures[1:]]
        rows.append([*cells, *figures])
    head = [_heading("controller", "controller", "", "text", "ascending")]
    figures = [_metric_heading(name) for name in metrics]
    if places:
        place = _heading("place", "place", "", "number", "ascending", sort="ascending")
        counts = [_heading("failed", "failed", "of all runs", "number", "ascending")]
        if judged:
            counts.append(_heading("not done", "task not done", "of completed", "number", "ascending"))
        counts.append(_heading("mean rank", "mean rank", "1 is best", "number", "ascending"))
        figures = [place, figures[0], *counts, *figures[1:]]
    head += figures
    caption = "Leaderboard" if places else f"Leaderboard: {', '.join(METRICS[m].heading for m in metrics)}"
    return html.table(caption, head, rows, classes)


def _metric_heading(name: str) -> str:
    metric = METRICS[name]
    first = "descending" if metric.lower_is_better is False else "ascending"
    better = {True: "less is better", False: "more is better", None: ""}[metric.lower_is_better]
    title = f"{name}: {metric.meaning}"
    return _heading(name, metric.heading, better, "number", first, title=title)


def _heading(
    name: str, words: str, below: str, kind: str, first: str, *, title: str = "", sort: str = "none"
) -> str:
    small = f"<small>{html.escape(below)}</small>" if below else ""
    return (
        f'<th scope="col" aria-sort="{sort}"><button type="button" data-kind="{kind}" data-first="{first}" '
        f'data-name="{html.escape(name)}" data-words="{html.escape(words)}" title="{html.escape(title)}">'
        f"{html.heading(words)}{small}</button></th>"
    )


def _number(value: int | None) -> str:
    return f'<td data-value="{"" if value is None else value}">{"–" if value is None else value}</td>'


def _failed(row: LeaderboardRow) -> str:
    detail = f"<small>{html.escape(counted_outcomes(row.failures))}</small>" if row.failed else ""
    classes = ' class="bad"' if row.failed else ""
    return f'<td data-value="{row.failed / row.runs:.6g}"{classes}>{row.failed} of {row.runs}{detail}</td>'


def _not_done(row: LeaderboardRow) -> str:
    share = row.not_done / row.completed if row.completed else 0.0
    classes = ' class="bad"' if row.not_done else ""
    return f'<td data-value="{share:.6g}"{classes}>{row.not_done} of {row.completed}</td>'


def _rank(rank: Interval) -> str:
    value = "" if rank.value is None else f"{rank.value:.6g}"
    return f'<td data-value="{value}">{number(rank.value)}{_below(rank)}</td>'


def _value(row: LeaderboardRow, best: bool) -> str:
    value = "" if row.value.value is None else f"{row.value.value:.9g}"
    text = f"<b>{number(row.value.value)}</b>" if best else number(row.value.value)
    missing = (
        f"<small>{row.undefined} undefined</small>" if row.undefined and row.value.value is not None else ""
    )
    return f'<td data-value="{value}">{text}{_below(row.value)}{missing}</td>'


def _below(interval: Interval) -> str:
    """The interval in small, or why there is none."""
    if interval.value is None:
        return ""
    reason = interval.note.removesuffix(": no interval").replace(
        "every seed gives the same", "same for all seeds"
    )
    return f"<small>{bracket(interval) or html.escape(reason)}</small>"


def _best(results: Results, metric: str, rows: Mapping[str, LeaderboardRow]) -> set[str]:
    """The best of the controllers that never failed, and those not worse by what matters; none if all are."""
    lower = METRICS[metric].lower_is_better
    values = {
        name: row.value.value for name, row in rows.items() if not row.failed and row.value.value is not None
    }
    if lower is None or len(set(values.values())) < 2:
        return set()
    best = min(values.values()) if lower else max(values.values())
    matters = results.runs.matters(metric)
    found = {name for name, value in values.items() if value == best or abs(value - best) < matters}
    return found if len(found) < len(rows) else set()


def failures_section(results: Results) -> str:
    """Outcomes of every controller; empty if every run completed and did its task."""
    runs = results.runs
    if bool(runs.completed.all()) and not bool(runs.not_done.any()):
        return ""
    outcomes = sorted(set(runs.outcome[~runs.completed].tolist()))
    rows: list[Sequence[str]] = []
    for index, name in enumerate(runs.controllers):
        mine = runs.of_controller(name)
        counts = [int((mine.outcome == outcome).sum()) for outcome in outcomes]
        counts = [int(mine.not_done.sum()), *counts]
        cells = [f'<td class="{"bad" if count else "zero"}">{count}</td>' for count in counts]
        label = f'<th scope="row">{html.swatch(index)}{html.breakable(name)}</th>'
        rows.append([label, f"<td>{len(mine)}</td>", f"<td>{int(mine.completed.sum())}</td>", *cells])
    words = [html.escape(outcome_words(outcome)) for outcome in outcomes]
    head = ["controller", "runs", "completed", "completed, task not done", *words]
    note = html.paragraph("A failed run is never averaged in and never dropped: it is counted here.")
    return html.section("failures", "Failures", note, html.table("Failures", head, rows))
