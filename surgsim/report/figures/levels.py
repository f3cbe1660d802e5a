"""Error against the levels of a disturbance, one line for each controller, failures on top."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from surgsim.array import Array
from surgsim.report.figures.scale import Scale
from surgsim.report.figures.svg import WIDTH, Drawing, colour, cross, dash, fmt, margin, mark, polyline

_STRIP, _ROW, _PLOT = 28.0, 13.0, 140.0
_SHIFT = 4.0


@dataclass(frozen=True, kw_only=True)
class LevelTrack:
    """One controller along the levels.

    Attributes:
        index: The controller's place, which gives its colour.
        middle: Median over completed runs (n,), NaN where none completed.
        low: Lowest completed run (n,).
        high: Highest completed run (n,).
        failures: What went wrong at each level (n,), empty where nothing did.
    """

    index: int
    middle: Array
    low: Array
    high: Array
    failures: Sequence[str]


def levels_plot(tracks: Sequence[LevelTrack], levels: Sequence[str], x_label: str, y_label: str) -> str:
    """Medians with whiskers over evenly spaced `levels`; a row of crosses for every controller that fails."""
    failing = [track for track in tracks if any(track.failures)]
    top = _STRIP + _ROW * len(failing) + (4 if failing else 0)
    bottom = top + _PLOT
    drawing = Drawing(bottom + 36)
    values = np.concatenate([part for t in tracks for part in (t.low, t.high)])
    positive = bool((values[np.isfinite(values)] > 0.0).all())
    y = Scale.over(values.tolist(), bottom, top, log=True if positive else None)
    left = margin(y)
    columns = [left + (WIDTH - 10 - left) * (k + 0.5) / len(levels) for k in range(len(levels))]
    _axes(drawing, y, columns, levels, (x_label, y.named(y_label)))
    for row, track in enumerate(failing):
        y_row = _STRIP + _ROW * (row + 0.5)
        drawing.path(mark(track.index, left - 8, y_row, 3.5), f"fill {colour(track.index)}")
        _crosses(drawing, columns, track, y_row)
    for k, track in enumerate(tracks):
        _track(drawing, [x + _SHIFT * (k - (len(tracks) - 1) / 2) for x in columns], y, track)
    said = f"{y.named(y_label)} against {x_label}, {len(tracks)} controllers, {len(failing)} fail."
    return drawing.render(said)


def _axes(
    drawing: Drawing, y: Scale, columns: Sequence[float], levels: Sequence[str], labels: tuple[str, str]
) -> None:
    left = margin(y)
    drawing.y_axis(y, left, WIDTH - 10, labels[1])
    drawing.path(f"M{fmt(left)} {fmt(y.start)}H{fmt(WIDTH - 10)}", "axis")
    for x, level in zip(columns, levels, strict=True):
        drawing.text(x, y.start + 14, level, "tick", "middle")
    drawing.text((left + WIDTH - 10) / 2, y.start + 30, labels[0], "label", "middle")


def _crosses(drawing: Drawing, columns: Sequence[float], track: LevelTrack, y: float) -> None:
    for x, failure in zip(columns, track.failures, strict=True):
        if failure:
            drawing.path(cross(x - 14, y, 3.5), f"line {colour(track.index)}")
            drawing.text(x - 7, y + 4, failure, "tick")


def _track(drawing: Drawing, columns: Sequence[float], y: Scale, track: LevelTrack) -> None:
    ink = colour(track.index)
    rows = [
        (x, y.at(b), y.at(c), y.at(d))
        for x, b, c, d in zip(
            columns, track.middle.tolist(), track.low.tolist(), track.high.tolist(), strict=True
        )
        if np.isfinite(b)
    ]
    if not rows:
        return
    drawing.path("".join(f"M{fmt(x)} {fmt(c)}V{fmt(d)}" for x, _, c, d in rows), f"line {ink}")
    drawing.path(polyline([(x, b) for x, b, _, _ in rows]), f"line {ink}", dash(track.index))
    drawing.path("".join(mark(track.index, x, b, 3.5) for x, b, _, _ in rows), f"fill {ink}")
