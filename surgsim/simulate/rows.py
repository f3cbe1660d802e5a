"""The rows of a trace while a run goes on."""

import numpy as np
from numpy.typing import NDArray

from surgsim.columns import Block
from surgsim.control.manipulability import manipulability_series
from surgsim.models.arm import ArmModel
from surgsim.trace.trace import Trace, TraceMeta

Array = NDArray[np.float64]
Group = tuple[Block, ...]


class Rows:
    """Preallocated rows; what is never written stays NaN.

    Args:
        base: Blocks of every trace.
        groups: Further blocks by who writes them, each group side by side in a row.
        rows: Most rows that can be written.

    Attributes:
        at: Where the columns of a block are in a row.
        group: Where those of a group are.
        data: The rows.
    """

    def __init__(self, base: Group, groups: dict[str, Group], rows: int) -> None:
        self._blocks = (*base, *(block for group in groups.values() for block in group))
        self.at: dict[str, slice] = {}
        width = 0
        for block in self._blocks:
            self.at[block.name] = slice(width, width + len(block.columns))
            width += len(block.columns)
        self.group: dict[str, slice] = {}
        first = sum(len(block.columns) for block in base)
        for name, group in groups.items():
            last = first + sum(len(block.columns) for block in group)
            self.group[name] = slice(first, last)
            first = last
        self.data = np.full((rows, width), np.nan)

    def begins(self, *names: str) -> NDArray[np.int64]:
        """Where blocks and groups begin in a row."""
        places = {**self.at, **self.group}
        return np.array([places[name].start for name in names], dtype=np.int64)

    def finish(self, count: int, meta: TraceMeta, arm: ArmModel) -> Trace:
        """The first `count` rows with the derived columns, as a trace."""
        data, at = self.data[:count].copy(), self.at
        tip, wrist, trocar = data[:, at["tip"]], data[:, at["wrist"]], data[:, at["trocar"]]
        data[:, at["tip_error"]] = np.linalg.norm(tip - data[:, at["tip_ref"]], axis=1, keepdims=True)
        axis = (tip - wrist) / np.linalg.norm(tip - wrist, axis=1, keepdims=True)
        data[:, at["rcm_error"]] = np.linalg.norm(np.cross(trocar - tip, axis), axis=1, keepdims=True)
        translational, whole = manipulability_series(arm, data[:, at["q"]])
        data[:, at["manipulability"]] = translational[:, None]
        data[:, at["manipulability_6d"]] = whole[:, None]
        data.flags.writeable = False
        return Trace(data, self._blocks, meta)
