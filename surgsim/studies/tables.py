"""Tables: rows of cells, how they are read, and how they are written."""

import csv
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

_T = TypeVar("_T")
Cell = str | int | float | None
Row = Mapping[str, Cell]
Tables = Mapping[str, Sequence[Row]]


def number(row: Row, column: str) -> float:
    """A cell that must be a number.

    Raises:
        TypeError: If it is none.
    """
    value = row[column]
    if isinstance(value, int | float):
        return float(value)
    raise TypeError(f"{column} is {value!r}, not a number")


def numbers(rows: Iterable[Row], column: str) -> list[float]:
    """The numbers of a column; empty cells are left out."""
    return [number(row, column) for row in rows if row[column] is not None]


def pick(rows: Iterable[Row], **wanted: Cell) -> list[Row]:
    """Rows with these cells."""
    return [row for row in rows if all(row[key] == value for key, value in wanted.items())]


def groups(rows: Iterable[Row], *columns: str) -> dict[tuple[Cell, ...], list[Row]]:
    """Rows by their cells of these columns, in the order in which they come first."""
    found: dict[tuple[Cell, ...], list[Row]] = {}
    for row in rows:
        found.setdefault(tuple(row[column] for column in columns), []).append(row)
    return found


def pairs(rows: Sequence[_T]) -> list[tuple[_T, _T]]:
    """First and second, third and fourth, and so on: two methods in turn."""
    return list(zip(rows[::2], rows[1::2], strict=True))


def span(values: Sequence[float], digits: int = 3) -> str:
    """`smallest to largest`, or the one number where they print alike."""
    low, high = f"{min(values):.{digits}g}", f"{max(values):.{digits}g}"
    return low if low == high else f"{low} to {high}"


def format_cell(value: Cell, digits: int = 4, column: str = "") -> str:
    """A cell as text: `digits` significant digits, two decimals for percents, a dash for None."""
    if value is None:
        return "-"
    if not isinstance(value, float):
        return str(value)
    return f"{value:.2f}" if "percent" in column else f"{value:#.{digits}g}".removesuffix(".")


def write_csv(path: Path, rows: Sequence[Row]) -> None:
    """Write a table with nine significant digits; None is an empty cell."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(rows[0])
        for row in rows:
            writer.writerow(["" if value is None else format_csv(value) for value in row.values()])


def format_csv(value: Cell) -> str:
    """A number with nine significant digits, anything else as it is."""
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def read_csv(path: Path, value: Callable[[str], Any] = str) -> list[dict[str, Any]]:
    """Rows of a table that `write_csv` wrote, each cell as `value` makes it of its text."""
    with path.open(newline="", encoding="utf-8") as file:
        return [{name: value(text) for name, text in row.items()} for row in csv.DictReader(file)]


def markdown_table(rows: Iterable[Row], digits: int = 4) -> str:
    """A table in Markdown, numbers right-aligned."""
    body = list(rows)
    names = list(body[0])
    numeric = [all(isinstance(row[name], int | float | None) for row in body) for name in names]
    lines = [
        "| " + " | ".join(name.replace("_", " ") for name in names) + " |",
        "|" + "|".join("---:" if right else "---" for right in numeric) + "|",
    ]
    lines += [
        "| " + " | ".join(format_cell(row[name], digits, name) for name in names) + " |" for row in body
    ]
    return "\n".join(lines)
