"""Figures for papers: errors of runs over time, a batch's controllers as box plots, tables of a study."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from surgsim.array import Array
from surgsim.compare.leaderboard import leaderboard
from surgsim.compare.observations import Observations
from surgsim.errors import SurgsimError
from surgsim.export.labels import told_apart
from surgsim.export.paper_style import (
    LOGARITHMIC,
    SUFFIXES,
    colours,
    figure_bytes,
    journal_style,
    new_figure,
    strokes,
)
from surgsim.export.study_figure import study_figure
from surgsim.export.subjects import BatchSubject, RunSubject, StudySubject, Subject, arm_by_arm, check_metrics
from surgsim.export.target import write_whole
from surgsim.metrics.catalog import METRICS
from surgsim.recording.polyline import drawn_rows

__all__ = ["SUFFIXES", "write_figure"]


_MM = 1e3
_ERRORS = (
    ("RCM error", "rcm_error_m", "rcm_error_max_m"),
    ("tip error", "tip_error_m", "tip_error_max_m"),
)
"""Heading, column of the trace, and key of the limit in the scenario's `safety`."""

_NEAR = 0.4
"""Share of a limit above which an axis reaches up to it."""

_DECADES = 100.0
"""How far a logarithmic axis reaches below the smallest of the runs' largest errors."""

_LETTERS = {"column": 56, "page": 120}
"""Letters of a legend that fit into a figure's width."""

_BESIDE_A_NAME = 7
"""Letters that the line before a name of the legend and the gap behind it take."""

_LINE_IN = 0.14
"""Height of a line of the legend [inch]."""

_MOST_OF_A_BATCH = 2
_MOST_POINTS = 150


def write_figure(
    path: Path,
    subjects: Sequence[Subject],
    metrics: Sequence[str] = (),
    width: str = "column",
    study_table: str | None = None,
) -> None:
    """Draw runs over time, the controllers of a batch, or a table of a study.

    Args:
        path: `.pdf`, `.svg` or `.png`.
        subjects: Runs; or one batch or study.
        metrics: Of a batch, the first two that its page ranks by if none is named; of a study columns.
        width: `column` or `page`, see `paper_style.WIDTHS_IN`.
        study_table: Which table of a study; None: the main one.

    Raises:
        SurgsimError: If there is nothing to draw, a run was not recorded, a metric is unknown, or the disk
            refuses.
    """
    check_metrics(subjects, metrics)
    subjects = arm_by_arm(subjects)
    runs = [subject for subject in subjects if isinstance(subject, RunSubject)]
    with journal_style():
        if len(runs) == len(subjects):
            figure = _over_time(runs, width)
        elif len(subjects) == 1 and isinstance(subjects[0], BatchSubject):
            figure = _by_controller(subjects[0], metrics, width)
        elif len(subjects) == 1 and isinstance(subjects[0], StudySubject):
            figure = study_figure(subjects[0], study_table, metrics, width)
        else:
            raise SurgsimError("--figure is of runs, or of one batch or one study: give these alone")
        content = figure_bytes(figure, path)
    write_whole(path, content)


def _over_time(runs: Sequence[RunSubject], width: str) -> Any:
    """Both errors of each run over time [mm, s], with the limits that end a run."""
    stacked = width == "column"
    figure = new_figure(width, 2.9 if stacked else 2.3)
    axes = figure.subplots(2, 1, sharex=True) if stacked else figure.subplots(1, 2)
    for ax, (heading, column, limit) in zip(axes, _ERRORS, strict=True):
        _error(ax, runs, column)
        ax.set_ylabel(f"{heading} [mm]")
        ax.grid(visible=True)
        _limits(ax, [_limit(run, limit) for run in runs], [_largest(run, column) for run in runs])
    for ax in axes[1:] if stacked else axes:
        ax.set_xlabel("time [s]")
    lines = {line.get_label(): line for ax in axes for line in ax.get_lines() if line.get_label()[0] != "_"}
    if len(lines) > 1 or len(runs) > 1:
        columns = _fitting(list(lines), _LETTERS[width])
        more = _LINE_IN * -(-len(lines) // columns)
        figure.set_size_inches(figure.get_figwidth(), figure.get_figheight() + more)
        figure.legend(lines.values(), lines, loc="outside upper center", ncols=columns, frameon=False)
    return figure


def _error(ax: Any, runs: Sequence[RunSubject], column: str) -> None:
    """A line for each run, through those rows that show it."""
    found = [value for run in runs if (value := _largest(run, column)) > 0.0]
    if not found:
        ax.text(0.5, 0.5, "not defined", transform=ax.transAxes, ha="center", va="center", color="0.4")
        ax.set_yticks([])
        return
    least = min(found) / _DECADES if max(found) > LOGARITHMIC * min(found) else 0.0
    names = told_apart(runs)
    for run, name, colour, stroke in zip(runs, names, colours(len(runs)), strokes(len(runs)), strict=True):
        values = run.trace[column] * _MM
        seen = np.log(np.maximum(values, least)) if least else values
        rows = drawn_rows(seen[:, np.newaxis])
        ax.plot(run.trace["t_s"][rows], values[rows], color=colour, linestyle=stroke, label=name)
    if least:
        ax.set_yscale("log")
        ax.set_ylim(least, 2.0 * max(found))
    else:
        ax.set_ylim(0.0, 1.08 * max(found))
    ax.margins(x=0.01)


def _largest(run: RunSubject, column: str) -> float:
    """Largest error of a run [mm]; 0 where it defines none."""
    values = run.trace[column] * _MM
    finite = values[np.isfinite(values)]
    return float(finite.max()) if finite.size else 0.0


def _limit(run: RunSubject, key: str) -> float | None:
    """The run's limit [mm]; None without one."""
    value = run.trace.meta.scenario["safety"][key]
    return None if value is None else value * _MM


def _limits(ax: Any, limits: Sequence[float | None], largest: Sequence[float]) -> None:
    """The limit that the runs share, as a line if they come near it, else in words above the axis."""
    limit = limits[0]
    if limit is None or any(other != limit for other in limits) or max(largest) == 0.0:
        return
    if max(largest) > _NEAR * limit or ax.get_yscale() == "log":
        ax.axhline(limit, color="black", linewidth=0.8, linestyle=(0, (5, 2)), label="limit")
        low, high = ax.get_ylim()
        ax.set_ylim(low, max(high, (2.0 if ax.get_yscale() == "log" else 1.08) * limit))
    else:
        ax.set_title(f"limit {limit:g} mm", loc="right", fontsize=7, color="0.35", pad=2)


def _fitting(names: Sequence[str], letters: int) -> int:
    """How many columns of a legend fit into a line of so many letters; it is filled column by column."""
    for columns in range(len(names), 1, -1):
        rows = -(-len(names) // columns)
        widest = [max(map(len, names[first : first + rows])) for first in range(0, len(names), rows)]
        if sum(widest) + _BESIDE_A_NAME * len(widest) <= letters:
            return columns
    return 1


def _by_controller(batch: BatchSubject, metrics: Sequence[str], width: str) -> Any:
    """A box of each controller's completed runs, its runs as points, failures in words beside it."""
    runs = batch.results.runs
    shown = list(metrics) or batch.results.headline[:_MOST_OF_A_BATCH]
    if not shown:
        raise SurgsimError(f"{batch.path}: no run completed: there is nothing to draw")
    names = [row.controller for row in leaderboard(runs, shown[0], places=False)]
    stacked = width == "column"
    height = 0.62 + 0.24 * len(names)
    figure = new_figure(width, height * len(shown) if stacked else height + 0.2)
    shape = (len(shown), 1) if stacked else (1, len(shown))
    axes = figure.subplots(*shape, squeeze=False).ravel()
    for index, (ax, metric) in enumerate(zip(axes, shown, strict=True)):
        _boxes(ax, runs, metric, names)
        ax.set_xlabel(METRICS[metric].heading)
        ax.set_yticks(range(len(names)), names if stacked or not index else [])
    return figure


def _boxes(ax: Any, runs: Observations, metric: str, names: Sequence[str]) -> None:
    """Boxes from quartile to quartile, whiskers to the last run within 1.5 of its length (Tukey)."""
    groups = [runs.of_controller(name) for name in names]
    values = [_finite(group.values(metric)) for group in groups]
    medians = [float(np.median(each)) for each in values if each.size]
    everything = np.concatenate(values) if values else np.zeros(0)
    if medians and min(everything) > 0.0 and max(medians) > LOGARITHMIC * min(medians):
        ax.set_xscale("log")
    for place, (each, colour) in enumerate(zip(values, colours(len(names)), strict=True)):
        _box(ax, each, place, colour)
    ax.set_ylim(len(names) - 0.5, -0.5)
    ax.grid(visible=True, axis="x")
    ax.tick_params(axis="y", length=0)
    for place, group in enumerate(groups):
        failed = int((~group.completed).sum())
        if failed:
            text = f"{failed} of {len(group)} failed"
            ax.annotate(
                text, (1.0, place), xycoords=("axes fraction", "data"), xytext=(2, 0),
                textcoords="offset points", va="center", fontsize=6, color="0.25",
            )  # fmt: skip


def _box(ax: Any, values: Array, place: int, colour: str) -> None:
    if not values.size:
        return
    thin = {"color": colour, "linewidth": 0.8}
    ax.boxplot(
        [values],
        positions=[place],
        widths=0.6,
        orientation="horizontal",
        showfliers=False,
        boxprops=thin,
        whiskerprops=thin,
        capprops=thin,
        medianprops={"color": "black", "linewidth": 1.2},
        manage_ticks=False,
        zorder=3,
    )
    points = np.sort(values)
    if points.size > _MOST_POINTS:
        points = points[np.linspace(0, points.size - 1, _MOST_POINTS).astype(int)]
    spread = place + 0.4 * ((np.arange(points.size) * 0.618034) % 1.0 - 0.5)
    ax.plot(points, spread, "o", color=colour, markersize=1.8, alpha=0.6, markeredgewidth=0.0, zorder=2)


def _finite(values: Array) -> Array:
    return values[np.isfinite(values)]
