"""Small arrays that a kernel needs while it runs, on its stack: free, where `np.empty` costs 30 ns.

Such an array is gone when the function returns that asked for it. A kernel hands it to others to fill or
read, and never returns it, nor keeps it.

They are lowered where they stand. As inlined overloads they would have numba look for dead code in every
kernel that uses one, and it takes writes to a record's array for dead where the record is laid over an array.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import lower_builtin, type_callable
from numba.np.arrayobj import make_array, populate_array

from surgsim.array import Array
from surgsim.tick.arrays import MOST_JOINTS

MOST_ROWS = MOST_JOINTS + 1
"""Most rows and columns of a scratch matrix."""
_MATRIX = MOST_ROWS * MOST_ROWS
_VECTOR = 40
"""Most entries of a scratch vector: the VPRNN's unknowns, 18 more than joints and rows."""
_LONG, _WIDE = "a scratch vector has at most 40 entries", "a scratch matrix has at most 81 entries"
_BYTES = 8


def scratch(size: int) -> Array:
    """An array (size,) of any content.

    Raises:
        ValueError: If it is larger than 40 entries.
    """
    if size > _VECTOR:
        raise ValueError(_LONG)
    return np.empty(size)


def scratch_matrix(rows: int, columns: int) -> Array:
    """An array (rows, columns) of any content.

    Raises:
        ValueError: If it is larger than 9 rows of 9.
    """
    if rows * columns > _MATRIX:
        raise ValueError(_WIDE)
    return np.empty((rows, columns))


def _stack_array(context: Any, builder: Any, kind: Any, shape: tuple[Any, ...], most: int, told: str) -> Any:
    """An array over doubles on the stack of the function that is being compiled, `most` of them."""
    size = shape[0]
    for length in shape[1:]:
        size = builder.mul(size, length)
    with builder.if_then(builder.icmp_signed(">", size, size.type(most)), likely=False):
        context.call_conv.return_user_exc(builder, ValueError, (told,))
    place = cgutils.alloca_once(builder, ir.DoubleType(), size=most)  # type: ignore[no-untyped-call]
    step = size.type(_BYTES)
    strides = [step]
    for length in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], length))
    array = make_array(kind)(context, builder)  # type: ignore[no-untyped-call]
    populate_array(array, data=place, shape=shape, strides=strides, itemsize=step, meminfo=None)  # type: ignore[no-untyped-call]
    return array._getvalue()


@type_callable(scratch)
def _type_scratch(context: Any) -> Any:
    def typer(size: Any) -> Any:
        return types.Array(types.float64, 1, "C") if isinstance(size, types.Integer) else None

    return typer


@lower_builtin(scratch, types.Integer)  # type: ignore[untyped-decorator,no-untyped-call]
def _lower_scratch(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    shape = _lengths(context, builder, signature, values)
    return _stack_array(context, builder, signature.return_type, shape, _VECTOR, _LONG)


@type_callable(scratch_matrix)
def _type_scratch_matrix(context: Any) -> Any:
    def typer(rows: Any, columns: Any) -> Any:
        whole = isinstance(rows, types.Integer) and isinstance(columns, types.Integer)
        return types.Array(types.float64, 2, "C") if whole else None

    return typer


@lower_builtin(scratch_matrix, types.Integer, types.Integer)  # type: ignore[untyped-decorator,no-untyped-call]
def _lower_scratch_matrix(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    shape = _lengths(context, builder, signature, values)
    return _stack_array(context, builder, signature.return_type, shape, _MATRIX, _WIDE)


def _lengths(context: Any, builder: Any, signature: Any, values: Any) -> tuple[Any, ...]:
    """Whole numbers of any kind as lengths."""
    return tuple(
        context.cast(builder, value, kind, types.intp)
        for value, kind in zip(values, signature.args, strict=True)
    )
