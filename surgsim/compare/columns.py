"""A small table: columns of one kind each, None where a row has nothing, as text and back."""

import enum
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from surgsim.packages import require

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

Value = str | int | float | bool | None


class Kind(enum.Enum):
    """What a column holds. The value is the word that a person reads."""

    TEXT = "text"
    INTEGER = "integer"
    NUMBER = "number"
    TRUTH = "truth value"


Schema = Mapping[str, Kind]
_INTEGERS = range(-(2**63), 2**63)
_INTEGER, _WORDS = re.compile(r"-?[0-9]+"), {"true": True, "false": False}
_CELL = re.compile(r'(?:"((?:[^"]|"")*+)"|([^",\r\n]*+))(,|\r?\n)')


@dataclass(frozen=True)
class Table:
    """Rows of a batch: `table["seed"]` is a column, `len(table)` the number of rows.

    Attributes:
        columns: Values by the column's name, each as many as there are rows; None where a row has nothing.

    Example:
        >>> import surgsim
        >>> found = surgsim.compare("circle_lwr4plus", controllers=["pinv", "qp"], task={"duration_s": 2.0})
        >>> found.table["controller"]
        ('pinv', 'qp')
        >>> found.table.rows()[0]["outcome"]
        'completed'
    """

    columns: Mapping[str, tuple[Value, ...]]

    @staticmethod
    def of_rows(rows: Sequence[Mapping[str, Any]], schema: Schema) -> "Table":
        """The table of `rows`; what a row does not name is None.

        Raises:
            ValueError: If a value is not of its column's kind.
        """
        return Table(
            {
                name: tuple(_checked(row.get(name), name, kind) for row in rows)
                for name, kind in schema.items()
            }
        )

    def __getitem__(self, name: str) -> tuple[Value, ...]:
        return self.columns[name]

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()), ()))

    def rows(self) -> list[dict[str, Any]]:
        """A mapping of names to values for each row."""
        names = tuple(self.columns)
        return [dict(zip(names, row, strict=True)) for row in zip(*self.columns.values(), strict=True)]

    def without(self, names: Sequence[str]) -> "Table":
        """The table without some of its columns."""
        return Table({name: column for name, column in self.columns.items() if name not in names})

    def to_pandas(self, schema: Schema) -> "pd.DataFrame":
        """The table as a data frame; NaN in a number, or None in anything else, where a row has nothing.

        Raises:
            SurgsimError: If pandas is not installed.
        """
        require("to_pandas needs", "pandas")
        import pandas as pd

        return pd.DataFrame(
            {
                name: np.array(column, dtype=np.float64) if schema[name] is Kind.NUMBER else list(column)
                for name, column in self.columns.items()
            }
        )

    def to_arrow(self, schema: Schema) -> "pa.Table":
        """The table as one of pyarrow, null where a row has nothing.

        Raises:
            SurgsimError: If pyarrow is not installed.
        """
        require("to_arrow needs", "pyarrow")
        import pyarrow as pa

        types = {
            Kind.TEXT: pa.string(),
            Kind.INTEGER: pa.int64(),
            Kind.NUMBER: pa.float64(),
            Kind.TRUTH: pa.bool_(),
        }
        fields = [pa.field(name, types[schema[name]]) for name in self.columns]
        arrays = [pa.array(self.columns[field.name], type=field.type) for field in fields]
        return pa.Table.from_arrays(arrays, schema=pa.schema(fields))


def csv_text(table: Table) -> str:
    """The table as CSV: every text in quotes, numbers to the last bit, and nothing for None."""
    lines = [",".join(map(_cell, table.columns))]
    lines += [",".join(map(_cell, row)) for row in zip(*table.columns.values(), strict=True)]
    return "\n".join(lines) + "\n"


def read_csv(text: str, schema: Schema) -> Table:
    """The table that `csv_text` wrote: those columns of it that `schema` names, in its order.

    Raises:
        ValueError: If the text is no such table, or a value is not of its column's kind.
    """
    lines = _lines(text)
    names = [cell or "" for cell in next(lines, [])]
    if len(set(names)) != len(names):
        raise ValueError("it has two columns of one name")
    rows = list(lines)
    for number, row in enumerate(rows, start=1):
        if len(row) != len(names):
            raise ValueError(f"row {number} has {len(row)} cells, not {len(names)}")
    place = {name: at for at, name in enumerate(names)}
    return Table(
        {
            name: tuple(_value(row[place[name]], name, kind) for row in rows)
            for name, kind in schema.items()
            if name in place
        }
    )


def _lines(text: str) -> Iterator[list["_Quoted | str | None"]]:
    """The cells of each line: what stands in quotes, what stands without, None where nothing does."""
    cells: list[_Quoted | str | None] = []
    at = 0
    while at < len(text):
        found = _CELL.match(text, at)
        if found is None:
            raise ValueError(f"it is no CSV at character {at}")
        quoted, plain, end = found.groups()
        cells.append(plain or None if quoted is None else _Quoted(quoted.replace('""', '"')))
        at = found.end()
        if end != ",":
            yield cells
            cells = []
    if cells:
        raise ValueError("it ends in the middle of a line")


class _Quoted(str):
    """A cell that stands in quotes: a text, if need be an empty one."""

    __slots__ = ()


def _cell(value: Value) -> str:
    if value is None:
        return ""
    if isinstance(value, str):
        return '"' + value.replace('"', '""') + '"'
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _value(cell: str | None, name: str, kind: Kind) -> Value:
    """What a cell says in a column of this kind."""
    if cell is None:
        return None
    try:
        if isinstance(cell, _Quoted) == (kind is Kind.TEXT):
            if kind is Kind.TEXT:
                return str(cell)
            if kind is Kind.NUMBER:
                return float(cell)
            if kind is Kind.TRUTH:
                return _WORDS[cell]
            if _INTEGER.fullmatch(cell) and int(cell) in _INTEGERS:
                return int(cell)
    except (ValueError, KeyError):
        pass
    raise ValueError(f"column '{name}' holds {cell[:40]!r}, which is no {kind.value}")


def _checked(value: Any, name: str, kind: Kind) -> Value:
    """`value` as a column of this kind holds it."""
    if value is None:
        return None
    if isinstance(value, bool):
        if kind is Kind.TRUTH:
            return value
    elif isinstance(value, str):
        if kind is Kind.TEXT:
            return value
    elif kind is Kind.NUMBER and isinstance(value, int | float):
        return float(value)
    elif kind is Kind.INTEGER and isinstance(value, int) and value in _INTEGERS:
        return value
    raise ValueError(f"column '{name}' is to hold a {kind.value}, not {str(value)[:40]!r}")
