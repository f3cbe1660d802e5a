"""Records laid over the flat arrays of numbers and memory that a kernel is given.

A law whose numbers are many reads them by name: its kernel views the beginning of `gains` as one record and
that of `memory` as another. Every field takes whole doubles, so that the record ends where tables of other
lengths begin.

    LAW, LAW_SIZE = overlay(Law)

    law = gains[:LAW_SIZE].view(LAW)[0]        # in a kernel and in Python
"""

from functools import cache
from typing import Any, TypeVar, cast

import numpy as np

from surgsim.array import Array
from surgsim.tick.arrays import Record, layout

R = TypeVar("R", bound=Record)


@cache
def overlay(kind: Any) -> tuple[Any, int]:
    """The type of a record of the class `kind`, and how many doubles it takes."""
    dtype = np.dtype((np.record, layout(kind, 0)))
    return dtype, dtype.itemsize // 8


def laid_over(kind: type[R], array: Array) -> R:
    """The record at the beginning of `array`, not copied."""
    of: Any = kind
    dtype, size = overlay(of)
    return cast(R, array[:size].view(dtype)[0])


def take(record: Record, config: object) -> None:
    """Fill the numbers of a record that a config has by the same name."""
    for name in record.dtype.names or ():
        if record.dtype[name] == np.float64 and hasattr(config, name):
            record[name] = getattr(config, name)
