"""Figures of a study's table: numbers beside the names of its rows, or as lines over what was varied.

The columns that tell rows apart are those from the left, as many as it takes. If one of them was varied in
numbers, as a delay is, and the others make few enough lines, the figure is lines over it; else it has a name
and a point for each row.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from surgsim.errors import SurgsimError, unknown_name
from surgsim.export.paper_style import COLOURS, LOGARITHMIC, colours, new_figure, strokes
from surgsim.export.subjects import StudySubject
from surgsim.studies.tables import Row, groups, numbers

MOST_ROWS, MOST_LINES, FEWEST_PLACES = 40, len(COLOURS), 3
"""Rows of points, lines, and places on a line that make it one."""

_MOST_COLUMNS = 2
_NAMES = ("seed", "home")
"""Columns of whole numbers that name something: nothing varies with them."""

_UNITS = {
    "mm_per_s": "mm/s", "rad_per_s": "rad/s", "n_per_m": "N/m", "per_s": "1/s", "mm": "mm", "m": "m",
    "rad": "rad", "ms": "ms", "us": "µs", "s": "s", "mj": "mJ", "j": "J", "nm": "N m", "n": "N", "kg": "kg",
    "percent": "%",
}  # fmt: skip
"""What a column's name ends with, the longest first, and the unit that it stands for."""


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """What is drawn of a table.

    Attributes:
        rows: Its rows.
        keys: Columns that tell them apart.
        over: The key that lines are drawn over; empty if there are none.
        shown: Columns of numbers, an axis each.
    """

    rows: Sequence[Row]
    keys: tuple[str, ...]
    over: str
    shown: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Keys that name a line or a row."""
        return tuple(key for key in self.keys if key != self.over)

    @property
    def lines(self) -> dict[str, list[Row]]:
        """Rows by what names their line."""
        found = groups(self.rows, *self.names)
        return {_named(rows[0], self.names): rows for rows in found.values()}


def study_figure(study: StudySubject, table: str | None, columns: Sequence[str], width: str) -> Any:
    """A figure of a study's table.

    Args:
        study: The study.
        table: Which of its tables; None: the main one.
        columns: Columns of numbers; if none is named two that are no keys, those with a unit first.
        width: `column` or `page`.

    Raises:
        SurgsimError: If there is no such table or column, or the table is too long, without numbers, or of
            rows with units of their own.
    """
    name, rows = study.rows(table)
    drawn = _drawn(rows, columns)
    if isinstance(drawn, str):
        others = [other for other in study.tables if isinstance(_drawn(study.rows(other)[1], ()), Drawn)]
        another = f". --study-table names another: {', '.join(others)}" if others else ""
        raise SurgsimError(f"--figure: table '{name}' of {study.path} {drawn}{another}")
    return _over_a_key(drawn, width) if drawn.over else _points(drawn, width)


def _drawn(rows: Sequence[Row], columns: Sequence[str]) -> Drawn | str:
    """What is drawn of a table, or why nothing can be.

    Raises:
        SurgsimError: If a column is none of numbers.
    """
    keys = keys_of(rows)
    if len({_unit_in(str(row[keys[0]])) for row in rows}) > 1:
        return "has rows of different units, which no axis holds"
    known = [name for name in rows[0] if name not in keys and _of_numbers(rows, name)]
    known.sort(key=lambda name: "[" not in heading(name))
    if not known:
        return "has no column of numbers"
    for name in columns:
        if name not in known:
            raise SurgsimError(f"--metric: {unknown_name(name, 'column of numbers of this table', known)}")
    shown = tuple(columns) or tuple(known[:_MOST_COLUMNS])
    places = {key: len(groups(rows, key)) for key in keys if key not in _NAMES and _of_numbers(rows, key)}
    for over in sorted(places, key=lambda key: -places[key]):
        drawn = Drawn(rows=rows, keys=keys, over=over, shown=shown)
        if places[over] >= FEWEST_PLACES and len(drawn.lines) <= MOST_LINES:
            return drawn
    if len(rows) > MOST_ROWS:
        return f"has {len(rows)} rows, more than a figure shows: {MOST_ROWS}, or {MOST_LINES} lines"
    return Drawn(rows=rows, keys=keys, over="", shown=shown)


def _unit_in(words: str) -> str:
    """The unit in brackets at the end of a row's name: `mm` of `tip past a plane (mm)`."""
    found = re.search(r"\(([^()]*)\)$", words)
    return found[1] if found else ""


def keys_of(rows: Sequence[Row]) -> tuple[str, ...]:
    """The columns from the left that tell the rows apart."""
    names = list(rows[0])
    for count in range(1, len(names)):
        if len(groups(rows, *names[:count])) == len(rows):
            return tuple(names[:count])
    return tuple(names[:1])


def _of_numbers(rows: Sequence[Row], name: str) -> bool:
    cells = [row[name] for row in rows if row[name] is not None]
    return bool(cells) and all(isinstance(cell, int | float) for cell in cells)


def _over_a_key(drawn: Drawn, width: str) -> Any:
    """A line for each group of rows over the key."""
    count, lines = len(drawn.shown), drawn.lines
    stacked = width == "column"
    height = 1.5 * count if stacked else 2.3
    figure = new_figure(width, height + 0.16 * len(lines) * (len(lines) > 1) + 0.3)
    axes = figure.subplots(*((count, 1) if stacked else (1, count)), sharex=True, squeeze=False).ravel()
    styles = list(zip(colours(len(lines)), strokes(len(lines)), strict=True))
    for ax, name in zip(axes, drawn.shown, strict=True):
        for (label, rows), (colour, stroke) in zip(lines.items(), styles, strict=True):
            known = sorted(
                (row for row in rows if row[name] is not None and row[drawn.over] is not None),
                key=lambda row: numbers([row], drawn.over),
            )
            xs, ys = numbers(known, drawn.over), numbers(known, name)
            ax.plot(xs, ys, color=colour, linestyle=stroke, marker="o", markersize=2.5, label=label)
        ax.set_ylabel(heading(name))
        ax.grid(visible=True)
        _scaled(ax, "y", numbers(drawn.rows, name))
        _scaled(ax, "x", numbers(drawn.rows, drawn.over))
    for ax in axes[-1:] if stacked else axes:
        ax.set_xlabel(heading(drawn.over))
    if len(lines) > 1:
        handles, labels = axes[0].get_legend_handles_labels()
        columns = 1 if stacked else 2
        figure.legend(handles, labels, loc="outside upper center", ncols=columns, frameon=False)
    return figure


def _points(drawn: Drawn, width: str) -> Any:
    """A point for each row beside its name; the last key has the colour."""
    count, stacked = len(drawn.shown), width == "column"
    words = [_named(row, drawn.keys) for row in drawn.rows]
    kinds = list(dict.fromkeys(str(row[drawn.keys[-1]]) for row in drawn.rows))
    colour = dict(
        zip(kinds, colours(len(kinds)) if len(kinds) < len(words) else COLOURS[:1] * len(kinds), strict=True)
    )
    height = 0.5 + 0.15 * len(words)
    figure = new_figure(width, height * count if stacked else height)
    axes = figure.subplots(*((count, 1) if stacked else (1, count)), squeeze=False).ravel()
    for index, (ax, name) in enumerate(zip(axes, drawn.shown, strict=True)):
        for place, row in enumerate(drawn.rows):
            found = numbers([row], name)
            ax.plot(found, [place] * len(found), "o", markersize=3.5, color=colour[str(row[drawn.keys[-1]])])
        ax.set_yticks(range(len(words)), words if stacked or not index else [])
        ax.set_ylim(len(words) - 0.5, -0.5)
        ax.set_xlabel(heading(name))
        ax.grid(visible=True)
        ax.tick_params(axis="y", length=0)
        _scaled(ax, "x", numbers(drawn.rows, name))
    return figure


def _scaled(ax: Any, axis: str, values: Sequence[float]) -> None:
    """A logarithmic axis where the values are positive and far apart."""
    finite = [value for value in values if np.isfinite(value)]
    if finite and min(finite) > 0.0 and max(finite) > LOGARITHMIC * min(finite):
        ax.set(**{f"{axis}scale": "log"})


def heading(name: str) -> str:
    """A column's name in words, its unit in brackets: `tip rms [mm]` of `tip_rms_mm`."""
    for ending, unit in _UNITS.items():
        if name.endswith(f"_{ending}"):
            return f"{name.removesuffix(f'_{ending}').replace('_', ' ')} [{unit}]"
    return name.replace("_", " ")


def _named(row: Row, keys: Sequence[str]) -> str:
    """A row's keys in words, a number with what it is of: `normal, delay [ms] 100`."""
    return ", ".join(_word(key, row[key]) for key in keys)


def _word(key: str, cell: object) -> str:
    if isinstance(cell, int | float):
        return f"{heading(key)} {cell:g}"
    return "–" if cell is None else str(cell).replace("_", " ")
