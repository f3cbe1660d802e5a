"""Small arrays that a kernel needs while it runs, on its stack: free, where `np.empty` costs 30 ns.

Such an array is gone when the function returns that asked for it. A kernel hands it to others to fill or
read, and never returns it, nor keeps it.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import carray, types  # type: ignore[attr-defined]
from numba.core import cgutils
from numba.extending import intrinsic, overload

from surgsim.tick.arrays import MOST_JOINTS, Array

MOST_ROWS = MOST_JOINTS + 1
"""Most rows and columns of a scratch matrix."""
_MATRIX = MOST_ROWS * MOST_ROWS
_VECTOR = 40
"""Most entries of a scratch vector: the VPRNN's unknowns, 18 more than joints and rows."""


def _on_stack(size: int) -> Any:
    """The intrinsic that sets doubles aside on the stack of the function that it stands in."""

    @intrinsic
    def stack(context: Any) -> Any:
        def generate(_: Any, builder: Any, signature: Any, values: Any) -> Any:
            place = cgutils.alloca_once(builder, ir.DoubleType(), size=size)  # type: ignore[no-untyped-call]
            return builder.bitcast(place, cgutils.voidptr_t)

        return types.voidptr(), generate

    return stack


_vector_on_stack = _on_stack(_VECTOR)
_matrix_on_stack = _on_stack(_MATRIX)


def scratch(size: int) -> Array:
    """An array (size,) of any content.

    Raises:
        ValueError: If it is larger than 40 entries.
    """
    if size > _VECTOR:
        raise ValueError("a scratch vector has at most 40 entries")
    return np.empty(size)


def scratch_matrix(rows: int, columns: int) -> Array:
    """An array (rows, columns) of any content.

    Raises:
        ValueError: If it is larger than 9 rows of 9.
    """
    if rows * columns > _MATRIX:
        raise ValueError("a scratch matrix has at most 81 entries")
    return np.empty((rows, columns))


@overload(scratch, inline="always")
def _scratch(size: Any) -> Any:
    def view(size: Any) -> Any:
        if size > _VECTOR:
            raise ValueError("a scratch vector has at most 40 entries")
        return carray(_vector_on_stack(), (size,), np.float64)

    return view


@overload(scratch_matrix, inline="always")
def _scratch_matrix(rows: Any, columns: Any) -> Any:
    def view(rows: Any, columns: Any) -> Any:
        if rows * columns > _MATRIX:
            raise ValueError("a scratch matrix has at most 81 entries")
        return carray(_matrix_on_stack(), (rows, columns), np.float64)

    return view
