"""Frontiers over two axes of a suite, such as gain against delay: a map for each controller."""

import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from surgsim.compare.observations import Observations
from surgsim.metrics.catalog import METRICS
from surgsim.report import html
from surgsim.report.axes import Axis, axes_of
from surgsim.report.figures.heat import HeatMap, heat_map, shades_of
from surgsim.report.figures.ticks import tick_text
from surgsim.report.results import Results, parameters_of

_METRICS = ("rcm_error_rms_mm", "tip_error_rms_mm")


def maps_section(results: Results) -> str:
    """Maps over the first two axes, at each level of the others; empty with fewer axes."""
    axes = axes_of(results)
    if len(axes) < 2:
        return ""
    x, y, *others = axes
    note = (
        f"Each cell: the median over seeds of the completed runs, the darker the larger, on one scale for "
        f"all maps of a metric. Crosses: failed runs of all. Across: {x.label}; upwards: {y.label}."
    )
    several = len(results.runs.scenarios) > 1
    parts = []
    for name, metric in itertools.product(results.runs.scenarios, _METRICS):
        if metric in results.metrics:
            title = f"{METRICS[metric].heading}, {name}" if several else METRICS[metric].heading
            drawn = _maps(results.runs.of_scenario(name), results.runs.controllers, (x, y), others, metric)
            parts.append(f"<h3>{html.escape(title)}</h3>{drawn}")
    return html.section("frontier", "Frontier", html.paragraph(note), *parts)


def _maps(
    runs: Observations,
    controllers: Sequence[str],
    plane: tuple[Axis, Axis],
    others: Sequence[Axis],
    metric: str,
) -> str:
    points = [parameters_of(text) for text in runs.parameters.tolist()]
    found: dict[tuple[tuple[float, ...], str], HeatMap] = {}
    for held in itertools.product(*(axis.levels for axis in others)):
        wanted = {axis.name: level for axis, level in zip(others, held, strict=True)}
        mask = np.array([all(point.get(k) == v for k, v in wanted.items()) for point in points], dtype=bool)
        for name in controllers:
            found[held, name] = _cells(runs.where(mask).of_controller(name), plane, metric)
    shades = shades_of(list(found.values()))
    rows = []
    for held, group in itertools.groupby(found, key=lambda key: key[0]):
        where = "; ".join(f"{a.label}: {tick_text(v)}" for a, v in zip(others, held, strict=True))
        rows.append(f"<h4>{html.escape(where)}</h4>" if where else "")
        drawn = [
            html.figure(
                heat_map(found[key], shades, plane[0].label, plane[1].label, METRICS[metric].heading),
                f"{key[1]}, {METRICS[metric].heading}",
            )
            for key in group
        ]
        rows.append(html.figures(*drawn))
    return "".join(rows)


def _cells(runs: Observations, plane: tuple[Axis, Axis], metric: str) -> HeatMap:
    x, y = plane
    points: list[Mapping[str, object]] = [parameters_of(text) for text in runs.parameters.tolist()]
    values, done = runs.values(metric), runs.completed
    size = (len(y.levels), len(x.levels))
    value, failed, count = np.full(size, np.nan), np.zeros(size, dtype=int), np.zeros(size, dtype=int)
    for place in itertools.product(range(size[0]), range(size[1])):
        here = np.array(
            [p.get(x.name) == x.levels[place[1]] and p.get(y.name) == y.levels[place[0]] for p in points],
            dtype=bool,
        )
        count[place], failed[place] = int(here.sum()), int((~done[here]).sum())
        if np.isfinite(values[here]).any():
            value[place] = np.nanmedian(values[here])
    return HeatMap(x=x.levels, y=y.levels, value=value, failed=failed, runs=count)
