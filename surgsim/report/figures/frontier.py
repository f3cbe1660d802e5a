"""Robustness frontier: a metric against a parameter of the grid, failures on top."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from surgsim.array import Array
from surgsim.report.figures.scale import Scale
from surgsim.report.figures.svg import WIDTH, Drawing, colour, cross, dash, fmt, margin, mark, polyline

_STRIP, _ROW, _PLOT = 24.0, 13.0, 150.0


@dataclass(frozen=True, kw_only=True)
class Track:
    """One controller along a parameter.

    Attributes:
        index: The controller's place, which gives its colour.
        x: The parameter's values (n,).
        middle: Median over completed runs (n,), NaN where none completed.
        low: 10 % quantile (n,).
        high: 90 % quantile (n,).
        failed: Failed runs (n,).
        runs: All runs (n,).
    """

    index: int
    x: Array
    middle: Array
    low: Array
    high: Array
    failed: NDArray[np.int64]
    runs: NDArray[np.int64]


def frontier_plot(tracks: Sequence[Track], x_label: str, y_label: str) -> str:
    """Median and 10 to 90 % of each track; above, a cross and a count where runs failed."""
    failing = [track for track in tracks if track.failed.any()]
    top = _STRIP + _ROW * len(failing) + (8 if failing else 0)
    bottom = top + _PLOT
    drawing = Drawing(bottom + 36)
    values = np.concatenate([part for t in tracks for part in (t.middle, t.low, t.high)])
    y = Scale.over(values.tolist(), bottom, top)
    left = margin(y)
    x = Scale.over(np.concatenate([t.x for t in tracks]).tolist(), left + 16, WIDTH - 34)
    drawing.x_axis(x, _STRIP, bottom, x.named(x_label))
    drawing.y_axis(y, left, WIDTH - 10, y.named(y_label))
    for row, track in enumerate(failing):
        _crosses(drawing, x, track, _STRIP + _ROW * row)
    if failing:
        drawing.text(left - 5, _STRIP + 4 + _ROW * (len(failing) - 1) / 2, "failed", "tick", "end")
    for k, track in enumerate(tracks):
        _track(drawing, x, y, track, 3.0 * (k - (len(tracks) - 1) / 2))
    return drawing.render(f"{y.named(y_label)} against {x.named(x_label)}, {len(tracks)} controllers.")


def _crosses(drawing: Drawing, x: Scale, track: Track, y: float) -> None:
    for value, failed, runs in zip(track.x.tolist(), track.failed.tolist(), track.runs.tolist(), strict=True):
        if failed:
            drawing.path(cross(x.at(value), y, 3.5), f"line {colour(track.index)}")
            drawing.text(x.at(value) + 7, y + 4, f"{failed}/{runs}", "tick")


def _track(drawing: Drawing, x: Scale, y: Scale, track: Track, shift: float) -> None:
    """Curve with whiskers, shifted sideways so that those of several controllers do not hide each other."""
    done = np.isfinite(track.middle)
    if not done.any():
        return
    ink = colour(track.index)
    columns = (track.x[done], track.middle[done], track.low[done], track.high[done])
    rows = [
        (x.at(a) + shift, y.at(b), y.at(c), y.at(d))
        for a, b, c, d in zip(*(column.tolist() for column in columns), strict=True)
    ]
    drawing.path("".join(f"M{fmt(a)} {fmt(c)}V{fmt(d)}" for a, _, c, d in rows), f"line {ink}")
    drawing.path(polyline([(a, b) for a, b, _, _ in rows]), f"line {ink}", dash(track.index))
    drawing.path("".join(mark(track.index, a, b, 3.5) for a, b, _, _ in rows), f"fill {ink}")
