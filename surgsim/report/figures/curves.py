"""Curves with bands: errors over time, performance profiles."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from surgsim.array import Array
from surgsim.report.figures.scale import Scale
from surgsim.report.figures.svg import WIDTH, Drawing, colour, cross, dash, fmt, margin, mark, polyline

_TOP, _BOTTOM = 22.0, 186.0


@dataclass(frozen=True, kw_only=True)
class Curve:
    """A curve of one controller.

    Attributes:
        index: The controller's place, which gives its colour and dashes.
        x: Abscissae (n,).
        middle: The curve (n,).
        low: Lower edge of its band (n,); None without a band.
        high: Upper edge (n,).
        ended: Curves of failed runs (n,), NaN after their end; each ends in a cross.
        steps: Whether the curve jumps at its abscissae.
    """

    index: int
    x: Array
    middle: Array
    low: Array | None = None
    high: Array | None = None
    ended: tuple[Array, ...] = field(default=())
    steps: bool = False


def curve_plot(
    curves: Sequence[Curve], x_label: str, y_label: str, *, log_x: bool = False, unit_y: bool = False
) -> str:
    """All `curves` in one frame; `unit_y`: ordinates are shares from 0 to 1."""
    drawing = Drawing(_BOTTOM + 36)
    y = Scale.over([0.0, 1.0] if unit_y else _heights(curves), _BOTTOM, _TOP, log=False if unit_y else None)
    left = margin(y)
    x = Scale.over(np.concatenate([c.x for c in curves]).tolist(), left, WIDTH - 10, log=log_x)
    if not log_x:
        x = Scale(low=float(min(c.x[0] for c in curves)), high=x.high, start=x.start, end=x.end)
    drawing.x_axis(x, _TOP, _BOTTOM, x.named(x_label))
    drawing.y_axis(y, left, WIDTH - 10, y.named(y_label))
    for curve in curves:
        if curve.low is not None and curve.high is not None:
            there = _points(x, y, curve, curve.low)
            back = _points(x, y, curve, curve.high)[::-1]
            if there:
                drawing.path(polyline(there + back) + "z", f"band {colour(curve.index)}")
    for curve in curves:
        for values in curve.ended:
            _failed(drawing, _points(x, y, curve, values), curve.index)
        points = _points(x, y, curve, curve.middle)
        if points:
            drawing.path(polyline(points), f"line {colour(curve.index)}", dash(curve.index))
    return drawing.render(f"{y.named(y_label)} over {x.named(x_label)}, {len(curves)} controllers.")


def _heights(curves: Sequence[Curve]) -> list[float]:
    """Every ordinate that is drawn."""
    parts = [part for c in curves for part in (c.middle, c.low, c.high, *c.ended) if part is not None]
    values = np.concatenate(parts)
    return [float(x) for x in values[np.isfinite(values)]] or [0.0, 1.0]


def _points(x: Scale, y: Scale, curve: Curve, values: Array) -> list[tuple[float, float]]:
    places = [
        (x.at(a), y.at(b)) for a, b in zip(curve.x.tolist(), values.tolist(), strict=True) if np.isfinite(b)
    ]
    if not curve.steps:
        return places
    corners = [p for (_, before), (at, now) in itertools.pairwise(places) for p in ((at, before), (at, now))]
    return places[:1] + corners


def _failed(drawing: Drawing, points: list[tuple[float, float]], index: int) -> None:
    """A thin line that ends in a cross."""
    if points:
        drawing.path(polyline(points), f"line thin {colour(index)}", dash(index))
        drawing.path(cross(*points[-1]), f"line {colour(index)}")


def legend_mark(index: int) -> str:
    """A sample of a controller's line, for a legend."""
    line = f'<path class="line {colour(index)}" d="M0 7H30"{dash(index)}/>'
    point = f'<path class="fill {colour(index)}" d="{mark(index, 15, 7, 3.5)}"/>'
    return f'<svg class="key" viewBox="0 0 {fmt(30)} {fmt(14)}" aria-hidden="true">{line}{point}</svg>'
