"""Robustness: error against the level of each disturbance, and where every controller fails."""

from collections.abc import Sequence

import numpy as np

from surgsim.compare.failures import WORST_RCM_MM
from surgsim.compare.observations import Observations
from surgsim.metrics.catalog import METRICS
from surgsim.report import html
from surgsim.report.axes import Axis, sweeps_of
from surgsim.report.failing import AtLevel, along, at_level
from surgsim.report.figures.levels import LevelTrack, levels_plot
from surgsim.report.figures.ticks import tick_text
from surgsim.report.results import Results

_METRICS = ("rcm_error_rms_mm", "tip_error_rms_mm", "trocar_force_rms_n")
_UNDISTURBED, _OFF = "undisturbed", "off"


def robustness_section(results: Results) -> str:
    """Panels and table for every scenario; empty for a suite without sweeps."""
    sweeps = sweeps_of(results)
    if not sweeps:
        return ""
    note = (
        "Each disturbance alone, at rising levels; leftmost, `off`, without any. Lines: medians of the "
        "completed runs, whiskers from the lowest to the highest over seeds. A controller fails at a "
        f"level with a run that did not complete or an RCM error past {WORST_RCM_MM:g} mm: crosses "
        "above, with the failed runs of all."
    )
    several = len(results.runs.scenarios) > 1
    parts = []
    for name in results.runs.scenarios:
        parts += [f"<h3>{html.escape(name)}</h3>"] if several else []
        parts.append(_scenario(results.runs.of_scenario(name), results, sweeps))
    legend = html.legend(results.runs.controllers)
    return html.section("robustness", "Robustness", html.paragraph(note), legend, *parts)


def _scenario(runs: Observations, results: Results, sweeps: Sequence[Axis]) -> str:
    parts = [_table(runs, results.runs.controllers, sweeps)]
    for metric in (name for name in _METRICS if name in results.metrics):
        panels = [_panel(runs, results.runs.controllers, sweep, sweeps, metric) for sweep in sweeps]
        parts.append(html.details(f"{METRICS[metric].heading} over the levels", html.figures(*panels)))
    return "".join(parts)


def _panel(
    runs: Observations, controllers: Sequence[str], sweep: Axis, sweeps: Sequence[Axis], metric: str
) -> str:
    """One disturbance; empty if the metric is not defined under it."""
    tracks = []
    for index, name in enumerate(controllers):
        levels = along(runs.of_controller(name), sweep, sweeps)
        if any(len(level) for level in levels):
            tracks.append(_track(index, levels, metric))
    if not any(np.isfinite(track.middle[1:]).any() for track in tracks):
        return ""
    names = [_OFF, *map(tick_text, sweep.levels)]
    drawing = levels_plot(tracks, names, sweep.label, METRICS[metric].heading)
    return html.figure(drawing, sweep.name.replace("_", " "))


def _track(index: int, levels: Sequence[Observations], metric: str) -> LevelTrack:
    quantiles = np.full((3, len(levels)), np.nan)
    for k, runs in enumerate(levels):
        values = runs.values(metric)
        if np.isfinite(values).any():
            quantiles[:, k] = np.nanpercentile(values, [0, 50, 100])
    return LevelTrack(
        index=index,
        low=quantiles[0],
        middle=quantiles[1],
        high=quantiles[2],
        failures=[at_level(runs).mark for runs in levels],
    )


def _table(runs: Observations, controllers: Sequence[str], sweeps: Sequence[Axis]) -> str:
    head = ["fails at", *(html.swatch(k) + html.breakable(name) for k, name in enumerate(controllers))]
    rows = []
    for sweep in sweeps:
        title = html.escape(sweep.name.replace("_", " "))
        cells = [f'<th scope="row">{title}<small>{html.escape(sweep.label)}</small></th>']
        for name in controllers:
            levels = [at_level(level) for level in along(runs.of_controller(name), sweep, sweeps)]
            cells.append(_first_failure([_UNDISTURBED, *map(tick_text, sweep.levels)], levels))
        rows.append(cells)
    return html.table("Where each controller fails", head, rows, "fails")


def _first_failure(names: Sequence[str], levels: Sequence[AtLevel]) -> str:
    """The first level with a failure and what it was, or that there is none."""
    for name, level in zip(names, levels, strict=True):
        if level.mark:
            return f'<td class="bad">{html.escape(name)}<small>{html.escape(level.sentence)}</small></td>'
    tried = [name for name, level in zip(names, levels, strict=True) if level.runs]
    return f"–<small>holds to {html.escape(tried[-1])}</small>" if tried else "not run"
