"""Dot and interval for each controller: mean ranks, normalised scores."""

from collections.abc import Sequence

from surgsim.compare.figure_text import bracket, number
from surgsim.compare.intervals import Interval
from surgsim.report.figures.scale import Scale
from surgsim.report.figures.svg import WIDTH, Drawing, colour, fmt, mark, shortened

_ROW, _TOP = 36.0, 4.0


def interval_plot(rows: Sequence[tuple[str, int, Interval]], label: str) -> str:
    """A row for each controller: name, place of its colour, figure."""
    bottom = _TOP + _ROW * len(rows) + 4
    drawing = Drawing(bottom + 34)
    ends = [x for _, _, i in rows for x in (i.value, i.low, i.high) if x is not None]
    scale = Scale.over(ends, 12, WIDTH - 12)
    drawing.x_axis(scale, _TOP, bottom, scale.named(label))
    said = []
    for k, (name, index, interval) in enumerate(rows):
        y = _TOP + _ROW * k
        drawing.text(8, y + 13, shortened(name), "name")
        text = f"{number(interval.value, 4)} {bracket(interval, 4)}".rstrip()
        drawing.text(WIDTH - 10, y + 13, text, "tick", "end")
        said.append(f"{name}: {text}")
        if interval.value is not None:
            _whisker(drawing, scale, interval, index, y + 24)
    return drawing.render(f"{scale.named(label)}. {'; '.join(said)}.")


def _whisker(drawing: Drawing, scale: Scale, interval: Interval, index: int, y: float) -> None:
    if interval.low is not None and interval.high is not None and interval.value is not None:
        ends = f"M{fmt(scale.at(interval.low))} {fmt(y)}H{fmt(scale.at(interval.high))}"
        drawing.path(ends, f"line thick {colour(index)}")
    drawing.path(mark(index, scale.at(interval.value or 0.0), y), f"fill {colour(index)}")
