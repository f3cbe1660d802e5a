"""Robustness frontiers of a scenario: a metric against each numeric parameter of the grid."""

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from surgsim.compare.observations import Observations
from surgsim.metrics.catalog import METRICS
from surgsim.report import html
from surgsim.report.axes import axes_of, sweeps_of
from surgsim.report.figures.frontier import Track, frontier_plot
from surgsim.report.results import Results, parameters_of


def frontiers(runs: Observations, results: Results, controllers: Sequence[str]) -> str:
    """Figures for every numeric parameter of the grid with at least two values; empty without one."""
    points = [parameters_of(text) for text in runs.parameters.tolist()]
    drawn = []
    elsewhere = {axis.name for axis in (*axes_of(results), *sweeps_of(results))}
    for key in dict.fromkeys(key for point in points for key in point if key not in elsewhere):
        mask, fixed = _along(points, key)
        if mask.any():
            drawn.append(_frontiers(runs.where(mask), results, controllers, key, fixed))
    return "<h3>Robustness</h3>" + "".join(drawn) if drawn else ""


def _along(points: Sequence[dict[str, Any]], key: str) -> tuple[np.ndarray, str]:
    """Runs that differ in `key` alone, the other parameters at their first values, and those in words."""
    numbers = {point[key] for point in points if _is_number(point.get(key))}
    others = {name: value for name, value in points[0].items() if name != key}
    if len(numbers) < 2:
        return np.zeros(len(points), dtype=bool), ""
    same = [
        _is_number(point.get(key)) and {n: v for n, v in point.items() if n != key} == others
        for point in points
    ]
    return np.array(same), ", ".join(f"{name} = {json.dumps(value)}" for name, value in others.items())


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and bool(np.isfinite(value))


def _frontiers(runs: Observations, results: Results, controllers: Sequence[str], key: str, fixed: str) -> str:
    figures = []
    for metric in results.headline:
        tracks = [
            track
            for index, name in enumerate(controllers)
            if (track := _track(runs.of_controller(name), index, metric, key)) is not None
        ]
        if any(np.isfinite(track.middle).any() for track in tracks):
            drawing = frontier_plot(tracks, key, METRICS[metric].heading)
            figures.append(
                html.figure(drawing, METRICS[metric].heading, "median and 10–90 % of completed runs")
            )
    held = f", with {fixed}" if fixed else ""
    text = f"Against {key}{held}. Crosses: failed runs of all at that point."
    return html.paragraph(text) + html.figures(*figures)


def _track(runs: Observations, index: int, metric: str, key: str) -> Track | None:
    if not len(runs):
        return None
    x = np.array([float(parameters_of(text)[key]) for text in runs.parameters.tolist()])
    places = np.unique(x)
    values = runs.values(metric)
    quantiles = np.full((3, places.size), np.nan)
    for k, place in enumerate(places):
        there = values[x == place]
        if np.isfinite(there).any():
            quantiles[:, k] = np.nanpercentile(there, [10, 50, 90])
    return Track(
        index=index,
        x=places,
        low=quantiles[0],
        middle=quantiles[1],
        high=quantiles[2],
        failed=np.array([int((~runs.completed[x == place]).sum()) for place in places]),
        runs=np.array([int((x == place).sum()) for place in places]),
    )
