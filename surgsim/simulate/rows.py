"""The rows of a trace while a run goes on."""

import numpy as np
from numpy.typing import NDArray

from surgsim.columns import Block
from surgsim.control.manipulability import manipulability_series
from surgsim.models.arm import ArmModel
from surgsim.plant.truth import Truth
from surgsim.tasks.base import TipCommand
from surgsim.trace.trace import Trace, TraceMeta

Array = NDArray[np.float64]
Group = tuple[Block, ...]


class Rows:
    """Preallocated rows; what is never written stays NaN.

    Args:
        base: Blocks of every trace.
        groups: Further blocks by who writes them, each group side by side in a row.
        rows: Most rows that can be added.
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
        self._data = np.full((rows, width), np.nan)
        self._count = 0

    def add(self, t_s: float, truth: Truth, command: TipCommand | None) -> Array:
        """Begin the next row with what is known of every tick, also of one that ends the run or follows."""
        at = self.at
        row: Array = self._data[self._count]
        self._count += 1
        row[at["t"]] = t_s
        row[at["q"]] = truth.q
        row[at["v"]] = truth.v
        row[at["tip"]] = truth.p_WT
        if command is not None:
            row[at["tip_ref"]] = command.p_WTd
        row[at["wrist"]] = truth.p_WR
        row[at["trocar"]] = truth.p_WC
        row[at["infeasible"]] = row[at["stopped"]] = 0.0
        row[self.group["plant"]] = truth.values
        return row

    def finish(self, meta: TraceMeta, arm: ArmModel) -> Trace:
        """The rows written so far with the derived columns, as a trace."""
        data, at = self._data[: self._count].copy(), self.at
        tip, wrist, trocar = data[:, at["tip"]], data[:, at["wrist"]], data[:, at["trocar"]]
        data[:, at["tip_error"]] = np.linalg.norm(tip - data[:, at["tip_ref"]], axis=1, keepdims=True)
        axis = (tip - wrist) / np.linalg.norm(tip - wrist, axis=1, keepdims=True)
        data[:, at["rcm_error"]] = np.linalg.norm(np.cross(trocar - tip, axis), axis=1, keepdims=True)
        translational, whole = manipulability_series(arm, data[:, at["q"]])
        data[:, at["manipulability"]] = translational[:, None]
        data[:, at["manipulability_6d"]] = whole[:, None]
        data.flags.writeable = False
        return Trace(data, self._blocks, meta)
