"""Box plots: one row for each controller, its runs as points."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from surgsim.array import Array
from surgsim.compare.figure_text import number
from surgsim.report.figures.scale import Scale
from surgsim.report.figures.svg import WIDTH, Drawing, colour, fmt, shortened

MOST_POINTS = 150
_ROW, _TOP, _LEFT = 48.0, 4.0, 8.0


@dataclass(frozen=True, kw_only=True)
class Group:
    """Runs of a controller.

    Attributes:
        name: The controller.
        index: Its place, which gives its colour.
        values: The metric over completed runs (n,).
        runs: All runs, failures included.
        failed: Failed runs.
    """

    name: str
    index: int
    values: Array
    runs: int
    failed: int


def box_plot(groups: Sequence[Group], label: str) -> str:
    """Box from quartile to quartile, whiskers to the last run within 1.5 of its length (Tukey)."""
    bottom = _TOP + _ROW * len(groups) + 6
    drawing = Drawing(bottom + 34)
    everything = np.concatenate([group.values for group in groups])
    scale = Scale.over(everything.tolist(), _LEFT, WIDTH - 10)
    drawing.x_axis(scale, _TOP, bottom, scale.named(label))
    said = []
    for row, group in enumerate(groups):
        top = _TOP + _ROW * row
        drawing.text(_LEFT, top + 13, shortened(group.name), "name")
        drawing.text(WIDTH - 10, top + 13, _count(group), "bad" if group.failed else "tick", "end")
        if group.values.size:
            _box(drawing, scale, group, top + 29)
            said.append(f"{group.name}: median {number(float(np.median(group.values)))}")
    return drawing.render(f"Box plot of {scale.named(label)}. {'; '.join(said)}.")


def _count(group: Group) -> str:
    count = f"n = {group.values.size}"
    return f"{count}, {group.failed} of {group.runs} failed" if group.failed else count


def _box(drawing: Drawing, scale: Scale, group: Group, y: float) -> None:
    q1, median, q3 = np.percentile(group.values, [25, 50, 75]).tolist()
    reach = 1.5 * (q3 - q1)
    inside = group.values[(group.values >= q1 - reach) & (group.values <= q3 + reach)]
    ends = [scale.at(float(x)) for x in (inside.min(), q1, median, q3, inside.max())]
    low, left, middle, right, high = ends
    ink = colour(group.index)
    right = max(right, left + 1.0)
    drawing.path(f"M{fmt(low)} {fmt(y)}H{fmt(left)}M{fmt(right)} {fmt(y)}H{fmt(high)}", f"line {ink}")
    drawing.path(f"M{fmt(left)} {fmt(y - 9)}H{fmt(right)}V{fmt(y + 9)}H{fmt(left)}z", f"box {ink}")
    drawing.path(_points(scale, group, y), f"dots {ink}")
    drawing.path(f"M{fmt(middle)} {fmt(y - 9)}V{fmt(y + 9)}", f"median {ink}")


def _points(scale: Scale, group: Group, y: float) -> str:
    """Dots, spread over the box's height in a fixed pattern; at most MOST_POINTS, evenly taken in order."""
    values = np.sort(group.values)
    if values.size > MOST_POINTS:
        values = values[np.linspace(0, values.size - 1, MOST_POINTS).astype(int)]
    spread = (np.arange(values.size) * 0.618034) % 1.0
    places = zip(values.tolist(), spread.tolist(), strict=True)
    return "".join(f"M{fmt(scale.at(x))} {fmt(y - 6 + 12 * up)}h0" for x, up in places)
