"""Named columns with units, as MATLAB, NumPy and Parquet hold them."""

import io
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io import savemat

from surgsim.packages import require

UNITS, ABOUT = "surgsim_units", "surgsim_about"
"""Names beside the columns: the unit of each, and where all of it comes from, as JSON."""

_LONGEST_NAME = 63
_MAT_HEADER_BYTES = 116
_MAT_HEADER = b"MATLAB 5.0 MAT-file, written by surgsim"
_RESERVED = frozenset(
    {
        "break",
        "case",
        "catch",
        "classdef",
        "continue",
        "else",
        "elseif",
        "end",
        "for",
        "function",
        "global",
        "if",
        "otherwise",
        "parfor",
        "persistent",
        "return",
        "spmd",
        "switch",
        "try",
        "while",
    }
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Column:
    """A column.

    Attributes:
        name: Its name, which ends with its unit where it has one.
        values: Its values (rows,): float64, int64, or texts as objects; NaN or an empty text for none.
        unit: The unit; `1` of a pure number, empty of a text.
        meaning: What it is; may be empty.
    """

    name: str
    values: NDArray[Any]
    unit: str
    meaning: str = ""

    @property
    def is_text(self) -> bool:
        """Whether it holds texts."""
        return self.values.dtype == object


Encoder = Callable[[Sequence[Column], str], bytes]
"""From columns of equal length, and a JSON text about them, to the bytes of a file."""


def npz(columns: Sequence[Column], about: str) -> bytes:
    """A compressed NumPy archive: an array for each column, `surgsim_units` (columns, 2), `surgsim_about`."""
    arrays: dict[str, Any] = {
        column.name: column.values.astype(np.str_) if column.is_text else column.values for column in columns
    }
    arrays[UNITS] = np.array([[column.name, column.unit] for column in columns])
    arrays[ABOUT] = np.array(about)
    content = io.BytesIO()
    np.savez_compressed(content, allow_pickle=False, **arrays)
    return content.getvalue()


def parquet(columns: Sequence[Column], about: str) -> bytes:
    """Parquet: unit and meaning in each field's metadata, `about` in the schema's."""
    require("Parquet needs", "pyarrow")
    import pyarrow as pa
    import pyarrow.parquet as pq

    fields, arrays = [], []
    for column in columns:
        kind = pa.string() if column.is_text else pa.from_numpy_dtype(column.values.dtype)
        told = {"unit": column.unit, "meaning": column.meaning}
        fields.append(pa.field(column.name, kind, metadata={k: v for k, v in told.items() if v}))
        arrays.append(pa.array(column.values.tolist() if column.is_text else column.values, kind))
    table = pa.Table.from_arrays(arrays, schema=pa.schema(fields, metadata={ABOUT: about}))
    content = pa.BufferOutputStream()
    pq.write_table(table, content, compression="zstd")
    return bytes(content.getvalue())


def mat(columns: Sequence[Column], about: str) -> bytes:
    """A MATLAB 5 file: a variable (rows, 1) for each column, the structs `surgsim_units` and `surgsim_names`.

    Both structs have a field for each variable: its unit, and the column's own name, which differs where
    MATLAB would not take it. Texts are cell arrays.
    """
    names = matlab_names([column.name for column in columns])
    variables: dict[str, Any] = {}
    for column in columns:
        variables[names[column.name]] = column.values[:, np.newaxis]
    variables[UNITS] = {names[column.name]: column.unit for column in columns}
    variables["surgsim_names"] = {variable: name for name, variable in names.items()}
    variables[ABOUT] = about
    content = io.BytesIO()
    savemat(content, variables, long_field_names=True, do_compression=True, oned_as="column")
    data = bytearray(content.getvalue())
    data[:_MAT_HEADER_BYTES] = _MAT_HEADER.ljust(_MAT_HEADER_BYTES)  # instead of the time of day
    return bytes(data)


def matlab_names(names: Sequence[str]) -> Mapping[str, str]:
    """A variable's name for each column: a letter, then letters, digits, `_`; 63 at most; all different."""
    found: dict[str, str] = {}
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9_]", "_", name)
        if not re.match(r"[A-Za-z]", plain) or plain in _RESERVED:
            plain = f"x_{plain}"
        short, number = plain[:_LONGEST_NAME], 2
        while short in found.values():
            ending = f"_{number}"
            short, number = plain[: _LONGEST_NAME - len(ending)] + ending, number + 1
        found[name] = short
    return found


ENCODERS: Mapping[str, Encoder] = {".mat": mat, ".npz": npz, ".parquet": parquet}
