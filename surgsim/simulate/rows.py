"""The rows of a trace while a run goes on."""

import numpy as np
from numpy.typing import NDArray

from surgsim.array import Array
from surgsim.columns import Block, width
from surgsim.compiled import as_parameter
from surgsim.models.arm import ArmModel
from surgsim.simulate.derived import DERIVED_BLOCKS, derive, derive_signature
from surgsim.tick.arrays import Model, new
from surgsim.trace.trace import Trace, TraceMeta

Group = tuple[Block, ...]


class Rows:
    """Preallocated rows; what is never written stays NaN.

    Args:
        base: Blocks of every trace.
        groups: Further blocks by who writes them, each group side by side in a row.
        rows: Most rows that can be written.
        arm: The nominal arm, whose manipulability is derived.

    Attributes:
        at: Where the columns of a block are in a row.
        group: Where those of a group are.
        data: The rows.
    """

    def __init__(self, base: Group, groups: dict[str, Group], rows: int, arm: ArmModel) -> None:
        self._blocks = (*base, *(block for group in groups.values() for block in group))
        self.at: dict[str, slice] = {}
        end = 0
        for block in self._blocks:
            self.at[block.name] = slice(end, end + len(block.columns))
            end += len(block.columns)
        self.group: dict[str, slice] = {}
        first = width(base)
        for name, group in groups.items():
            last = first + width(group)
            self.group[name] = slice(first, last)
            first = last
        self.data = np.full((rows, end), np.nan)
        n = arm.limits.q_min.size
        self._model = new(Model, n)
        arm.point(self._model)
        self._derived = self.begins(*DERIVED_BLOCKS)
        self._derive = as_parameter(derive, derive_signature(n))

    def begins(self, *names: str) -> NDArray[np.int64]:
        """Where blocks and groups begin in a row."""
        places = {**self.at, **self.group}
        return np.array([places[name].start for name in names], dtype=np.int64)

    def put_back(self, rows: Array) -> None:
        """Be at the row after `rows`."""
        self.data[: len(rows)], self.data[len(rows) :] = rows, np.nan

    def finish(self, count: int, meta: TraceMeta, first: int = 0) -> Trace:
        """The rows from `first` on and before `count`, with the derived columns, as a trace."""
        data = self.data[first:count].copy()
        self._derive(self._model, data, self._derived)
        data.flags.writeable = False
        return Trace(data, self._blocks, meta)
