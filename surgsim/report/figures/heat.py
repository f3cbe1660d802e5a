"""Heat map: a metric over two axes, failed runs as crosses."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from surgsim.array import Array
from surgsim.compare.figure_text import number
from surgsim.report.figures.scale import Scale
from surgsim.report.figures.svg import WIDTH, Drawing, cross, fmt
from surgsim.report.figures.ticks import tick_text

_LEFT, _TOP, _ROW = 46.0, 24.0, 34.0
_LIGHTEST, _DARKEST = 0.05, 0.5


@dataclass(frozen=True, kw_only=True)
class HeatMap:
    """Cells of one controller, rows from the bottom up.

    Attributes:
        x: Levels along the columns (n,).
        y: Levels along the rows (m,).
        value: Figure of each cell (m, n); NaN where no run completed.
        failed: Failed runs (m, n).
        runs: All runs (m, n).
    """

    x: Sequence[float]
    y: Sequence[float]
    value: Array
    failed: NDArray[np.int64]
    runs: NDArray[np.int64]


def heat_map(cells: HeatMap, shades: Scale, x_label: str, y_label: str, what: str) -> str:
    """Every cell with its number, the darker the larger; a cross and a count where runs failed.

    Args:
        cells: The cells.
        shades: From values to opacities, the same for maps that are to be compared.
        x_label: Of the columns.
        y_label: Of the rows.
        what: What the numbers are, for a screen reader.
    """
    bottom = _TOP + _ROW * len(cells.y)
    width = (WIDTH - 10 - _LEFT) / len(cells.x)
    drawing = Drawing(bottom + 36)
    drawing.text(2, 12, y_label, "label")
    for row, level in enumerate(cells.y):
        top = bottom - _ROW * (row + 1)
        drawing.text(_LEFT - 5, top + _ROW / 2 + 4, tick_text(level), "tick", "end")
        for column in range(len(cells.x)):
            _cell(drawing, cells, shades, (row, column), (_LEFT + width * column, top, width))
    for column, level in enumerate(cells.x):
        middle = _LEFT + width * (column + 0.5)
        drawing.text(middle, bottom + 14, tick_text(level), "tick", "middle")
    drawing.text((_LEFT + WIDTH - 10) / 2, bottom + 30, x_label, "label", "middle")
    return drawing.render(_said(cells, x_label, y_label, what))


def shades_of(maps: Sequence[HeatMap]) -> Scale:
    """A logarithmic scale from the least to the largest value of all `maps` to opacities."""
    values = np.concatenate([cells.value[np.isfinite(cells.value)] for cells in maps])
    values = values[values > 0.0]
    return Scale.over(values.tolist() or [1.0], _LIGHTEST, _DARKEST, log=True)


def _cell(
    drawing: Drawing,
    cells: HeatMap,
    shades: Scale,
    place: tuple[int, int],
    box: tuple[float, float, float],
) -> None:
    x, y, width = box
    value, failed, runs = float(cells.value[place]), int(cells.failed[place]), int(cells.runs[place])
    middle, low = x + width / 2, y + _ROW / 2
    outline = f"M{fmt(x + 1)} {fmt(y + 1)}H{fmt(x + width - 1)}V{fmt(y + _ROW - 1)}H{fmt(x + 1)}z"
    if np.isfinite(value):
        drawing.path(outline, "heat", f' fill-opacity="{shades.at(value):.2f}"')
        drawing.text(middle, low + (-2 if failed else 4), number(value), "", "middle")
    elif runs:
        drawing.path(outline, "lost")
    if failed:
        at = low + (9 if np.isfinite(value) else 0)
        drawing.path(cross(middle - 14, at, 3.5), "line bad")
        drawing.text(middle - 6, at + 4, f"{failed}/{runs}", "bad")


def _said(cells: HeatMap, x_label: str, y_label: str, what: str) -> str:
    lost = int(cells.failed.sum())
    return (
        f"{what} over {x_label} and {y_label}, {cells.value.size} cells; "
        f"{lost} of {int(cells.runs.sum())} runs failed."
    )
