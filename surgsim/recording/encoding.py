"""The exact trace as few bytes: what `encode` packs, `decode` gives back bit for bit.

Neighbouring rows of a smooth signal have nearly the same bits, so that their differences of some order are
small whole numbers. Each column is therefore

1. read as signed 64 bit integers, the bit patterns of its float64 values; no arithmetic on floats is done, so
   NaN payloads, infinities, -0.0 and subnormal numbers are patterns like any other;
2. replaced by its differences of order 0 to 4, modulo 2**64, the order that leaves the fewest bits;
3. zigzag coded (0, -1, 1, -2 become 0, 1, 2, 3), so that small negative numbers have leading zeros too;
4. split into eight planes, one for each byte of the numbers;

and all planes are compressed with zstd. Each step is undone exactly.
"""

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from surgsim.array import Array

Integers = NDArray[np.int64]

_WORD = np.dtype("<i8")
_ZERO = np.zeros(1, dtype=_WORD)
_HIGHEST_ORDER = 4  # a fifth difference gains little and makes noise worse
_WINDOWS = 8  # places of a column at which the orders are tried
_WINDOW_ROWS = 256
_LEVEL = 1


def encode(data: Array) -> bytes:
    """Pack `data` (rows, columns) without loss: a byte for each column's order, then the zstd stream."""
    values = np.ascontiguousarray(data.T, dtype="<f8").view(_WORD)
    orders = _orders(values)
    planes = np.empty((len(values), _WORD.itemsize, values.shape[1]), dtype=np.uint8)
    for column, order, out in zip(values, orders, planes, strict=True):  # one column stays in the cache
        out[:] = _zigzag(_differences(column, int(order))).view(np.uint8).reshape(-1, _WORD.itemsize).T
    return orders.tobytes() + bytes(_codec().compress(planes.data, asbytes=True))


def decode(packed: bytes, rows: int, columns: int) -> Array:
    """The array (rows, columns) that `encode` packed.

    Raises:
        ValueError: If `packed` does not hold so many numbers.
    """
    orders = np.frombuffer(packed[:columns], dtype=np.uint8)
    if orders.size != columns or (orders > _HIGHEST_ORDER).any() or min(rows, columns) < 1:
        raise ValueError("damaged recording: its columns are not packed as surgsim packs them")
    try:
        size = rows * columns * _WORD.itemsize
        stream = _codec().decompress(packed[columns:], decompressed_size=size)
        planes = np.frombuffer(stream, dtype=np.uint8).reshape(columns, _WORD.itemsize, rows)
    except (pa.ArrowException, OSError, OverflowError, MemoryError, ValueError) as error:
        raise ValueError(f"damaged recording: no {rows} rows of {columns} columns in it") from error
    values = np.empty((columns, rows), dtype=_WORD)
    for column, order, words in zip(values, orders, planes, strict=True):
        column[:] = _sums(_unzigzag(np.ascontiguousarray(words.T).view(_WORD)[:, 0]), int(order))
    return np.ascontiguousarray(values.view("<f8").T, dtype=np.float64)


def _codec() -> pa.Codec:
    return pa.Codec("zstd", compression_level=_LEVEL)


def _orders(values: Integers) -> NDArray[np.uint8]:
    """For every column of `values` (columns, rows) the order of difference that leaves the fewest bits.

    Tried on some windows of rows: a choice that is not the best costs bytes, never bits of the data.
    """
    rows = values.shape[1]
    if rows <= _WINDOWS * _WINDOW_ROWS:
        sample = values[:, None, :]
    else:
        starts = np.linspace(0, rows - _WINDOW_ROWS, _WINDOWS).astype(np.intp)
        sample = values[:, starts[:, None] + np.arange(_WINDOW_ROWS)]
    costs = []
    for order in range(_HIGHEST_ORDER + 1):
        costs.append(_bits(_zigzag(sample[:, :, _HIGHEST_ORDER - order :])).sum(axis=(1, 2)))
        sample = np.diff(sample, axis=2)
    best: NDArray[np.uint8] = np.argmin(costs, axis=0).astype(np.uint8)
    return best


def _bits(numbers: Integers) -> Integers:
    """About the number of bits of every one of `numbers`, taken as unsigned."""
    exponents: Integers = numbers.view(np.uint64).astype(np.float64).view(np.int64) >> 52
    return exponents.clip(1022) - 1022  # the exponent of 0 is 0, that of 1 is 1023


def _differences(column: Integers, order: int) -> Integers:
    """Differences of `column` (rows,) of an order; at each, the first number stays as it is."""
    for _ in range(order):
        column = np.diff(column, prepend=_ZERO)
    return column


def _sums(column: Integers, order: int) -> Integers:
    """Inverse of `_differences`."""
    for _ in range(order):
        column = np.cumsum(column)
    return column


def _zigzag(numbers: Integers) -> Integers:
    return (numbers << 1) ^ (numbers >> 63)


def _unzigzag(words: Integers) -> Integers:
    unsigned = words.view(np.uint64)
    return (unsigned >> np.uint64(1)).view(np.int64) ^ -(words & 1)
