"""Scenarios: a table of all, and of each box plots, errors over time, manipulability, comparisons."""

from collections.abc import Mapping, Sequence

import numpy as np

from surgsim.compare.figure_text import number
from surgsim.compare.observations import Observations
from surgsim.display import count
from surgsim.metrics.catalog import METRICS
from surgsim.report import html
from surgsim.report.figures.boxes import MOST_POINTS, Group, box_plot
from surgsim.report.figures.curves import Curve, curve_plot
from surgsim.report.results import Results, parameters_of
from surgsim.report.sections.comparisons import comparison_table
from surgsim.report.sections.frontier import frontiers
from surgsim.report.series import COLUMNS, Series

_ABREAST = 8
"""Controllers beside each other that a sheet of paper has room for."""


def scenarios_section(results: Results, series: Mapping[str, Series]) -> str:
    """A table of the main metric over scenarios, and everything about each one, folded."""
    names = results.runs.scenarios
    folded = [
        html.details(
            name,
            _scenario(results, name, series.get(name)),
            small=_facts(results.runs.of_scenario(name)),
            anchor=f"scenario-{index}",
        )
        for index, name in enumerate(names)
    ]
    return html.section("scenarios", "Scenario by scenario", _overview(results), *folded)


def _overview(results: Results) -> str:
    """Medians of the main metric, a row for each scenario, and how many runs failed."""
    if not results.metrics:
        return ""
    main, runs = results.headline[0], results.runs
    note = html.paragraph(
        f"Medians of {METRICS[main].heading} over completed runs; unfold one for its figures."
    )
    abreast = html.groups(runs.controllers, _ABREAST)
    return note + "".join(_medians(runs, main, controllers) for controllers in abreast)


def _medians(runs: Observations, metric: str, controllers: Sequence[str]) -> str:
    """A table: a row for each scenario, a column for each controller."""
    marks = [html.swatch(runs.controllers.index(name)) + html.breakable(name) for name in controllers]
    rows = []
    for name in runs.scenarios:
        mine = [runs.of_scenario(name).of_controller(controller) for controller in controllers]
        rows.append([f'<th scope="row">{html.breakable(name)}</th>', *(_median(one, metric) for one in mine)])
    return html.table(f"Scenarios: {', '.join(controllers)}", ["scenario", *marks], rows, "fails")


def _median(runs: Observations, metric: str) -> str:
    values = runs.values(metric)
    failed = len(runs) - int(runs.completed.sum())
    text = number(float(np.nanmedian(values))) if np.isfinite(values).any() else "–"
    lost = f"<small>{failed} of {len(runs)} failed</small>" if failed else ""
    return f'<td class="{"bad" if failed else ""}">{text}{lost}</td>'


def _scenario(results: Results, name: str, series: Series | None) -> str:
    """Everything about one scenario."""
    runs = results.runs.of_scenario(name)
    controllers = results.runs.controllers
    dexterity = [metric for metric in results.shown if metric.startswith("manipulability")]
    errors = [metric for metric in results.shown if metric not in dexterity]
    rest = [metric for metric in results.metrics if metric not in results.shown]
    pooled = len(set(runs.parameters.tolist())) > 1
    return "".join(
        (
            html.legend(controllers),
            html.paragraph("Box plots pool the grid points.") if pooled else "",
            "<h3>Errors and forces</h3>",
            html.figures(*(_boxes(runs, controllers, metric) for metric in errors)),
            "<h3>Over time</h3>" + _over_time(series, controllers, ("rcm_error_m", "tip_error_m")),
            "<h3>Manipulability</h3>" if dexterity else "",
            html.figures(
                *(_boxes(runs, controllers, metric) for metric in dexterity),
                *_bands(series, controllers, ("manipulability",)),
            ),
            frontiers(runs, results, controllers),
            _compared(results, name),
            html.details("More metrics", html.figures(*(_boxes(runs, controllers, m) for m in rest)))
            if rest
            else "",
        )
    )


def _facts(runs: Observations) -> str:
    done, seeds = int(runs.completed.sum()), len(set(runs.seed.tolist()))
    points = len(set(runs.parameters.tolist()))
    grid = f" × {points} grid points" if points > 1 else ""
    return (
        f"{count(len(runs), 'run')}: {count(len(runs.controllers), 'controller')} × "
        f"{count(seeds, 'seed')}{grid}; {done} completed, {len(runs) - done} failed"
    )


def _boxes(runs: Observations, controllers: Sequence[str], metric: str) -> str:
    groups = []
    for index, name in enumerate(controllers):
        mine = runs.of_controller(name)
        values = mine.values(metric)
        failed = len(mine) - int(mine.completed.sum())
        if len(mine):
            finite = values[np.isfinite(values)]
            groups.append(Group(name=name, index=index, values=finite, runs=len(mine), failed=failed))
    if not any(group.values.size for group in groups):
        return ""
    many = any(group.values.size > MOST_POINTS for group in groups)
    note = METRICS[metric].meaning + (f"; {MOST_POINTS} points of each drawn" if many else "")
    return html.figure(box_plot(groups, METRICS[metric].heading), METRICS[metric].heading, note)


def _over_time(series: Series | None, controllers: Sequence[str], columns: Sequence[str]) -> str:
    if series is None:
        return html.paragraph(
            "No recording is at hand, so errors over time are not drawn. "
            "`surgsim compare --record` writes recordings."
        )
    point = ", ".join(f"{key} = {value}" for key, value in parameters_of(series.parameters).items())
    runs = sum(len(next(iter(mine.values()))) for mine in series.completed.values())
    failed = sum(len(next(iter(mine.values()))) for mine in series.failed.values())
    if not runs + failed:
        return html.paragraph(f"None of {series.unreadable} recordings could be read.", "warning")
    text = (
        f"Median and 10–90 % band of {runs} recorded runs{f' at {point}' if point else ''}; each point is "
        f"the worst of its slice of {number(float(series.time_s[1] - series.time_s[0]))} s."
    )
    if failed:
        text += f" {failed} failed: of each controller up to three are thin lines that end in a cross."
    if series.unreadable:
        text += f" {series.unreadable} recordings could not be read."
    return html.paragraph(text) + html.figures(*_bands(series, controllers, columns))


def _bands(series: Series | None, controllers: Sequence[str], columns: Sequence[str]) -> list[str]:
    if series is None:
        return []
    drawn = []
    for column in columns:
        curves = [_curve(series, name, index, column) for index, name in enumerate(controllers)]
        there = [curve for curve in curves if curve is not None]
        if there:
            label = COLUMNS[column][0]
            drawn.append(
                html.figure(curve_plot(there, "time [s]", label), f"{label.split(' [')[0]} over time")
            )
    return drawn


def _curve(series: Series, name: str, index: int, column: str) -> Curve | None:
    done = series.completed.get(name, {}).get(column, np.empty((0, series.time_s.size)))
    failed = series.failed.get(name, {}).get(column, np.empty((0, series.time_s.size)))
    if not np.isfinite(done).any() and not np.isfinite(failed).any():
        return None
    some = np.isfinite(done).any(axis=0)
    middle, low, high = (np.full(series.time_s.size, np.nan) for _ in range(3))
    if some.any():
        low[some], middle[some], high[some] = np.nanpercentile(done[:, some], [10, 50, 90], axis=0)
    band = (low, high) if len(done) > 1 else (None, None)
    return Curve(
        index=index, x=series.time_s, middle=middle, low=band[0], high=band[1], ended=tuple(failed[:3])
    )


def _compared(results: Results, name: str) -> str:
    if len(results.runs.controllers) < 2:
        return ""
    tables = [
        f"<h4>{html.escape(METRICS[metric].heading)}</h4>{comparison_table(results, metric, name)}"
        for metric in results.headline
    ]
    return html.details("Controllers in pairs, in this scenario", *tables)
