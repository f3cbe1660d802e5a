"""Reading rows of a table."""

from collections.abc import Sequence

from surgsim.studies.study import Row


def number(row: Row, column: str) -> float:
    """A cell that must be a number."""
    value = row[column]
    if isinstance(value, int | float):
        return float(value)
    raise TypeError(f"{column} is {value!r}, not a number")


def numbers(rows: Sequence[Row], column: str) -> list[float]:
    """The numbers of a column; empty cells are left out."""
    return [number(row, column) for row in rows if row[column] is not None]


def pick(rows: Sequence[Row], **wanted: str | float) -> list[Row]:
    """Rows with these cells."""
    return [row for row in rows if all(row[key] == value for key, value in wanted.items())]


def span(values: Sequence[float], digits: int = 3) -> str:
    """`smallest to largest`, or the one number where they print alike."""
    low, high = f"{min(values):.{digits}g}", f"{max(values):.{digits}g}"
    return low if low == high else f"{low} to {high}"
