"""Immutable record of a run, one row per control tick."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from surgsim.array import Array
from surgsim.columns import Block, joints, scalar, vector
from surgsim.display import joined_names
from surgsim.errors import Outcome, UnknownNameError, not_held
from surgsim.packages import require

if TYPE_CHECKING:
    import pandas as pd


TIMING_COLUMNS = ("control_time_s",)
"""Columns that measure the machine, not the experiment: they differ between two equal runs."""


def base_blocks(n: int) -> tuple[Block, ...]:
    """Columns that every trace of an arm of n joints has.

    `tau_<term>` blocks, one per term of the torque law, follow, then what task, controller and plant add.
    """
    return (
        scalar("t", "s"),
        joints("q", "rad", n),
        joints("v", "rad_per_s", n),
        joints("tau", "nm", n),
        joints("qdot_ref", "rad_per_s", n),
        joints("q_ref", "rad", n),
        vector("tip", "m"),
        vector("tip_ref", "m"),
        vector("tip_believed", "m"),
        vector("wrist", "m"),
        vector("trocar", "m"),
        scalar("tip_error", "m"),
        scalar("rcm_error", "m"),
        scalar("rcm_error_believed", "m"),
        scalar("manipulability"),
        scalar("manipulability_6d"),
        scalar("resolver_residual", "m_per_s"),
        scalar("saturated_joints"),
        scalar("control_time", "s"),
        scalar("infeasible"),
        scalar("stopped"),
    )


@dataclass(frozen=True, kw_only=True)
class Ending:
    """How and when a run ended.

    Attributes:
        outcome: The kind of end.
        t_s: Time of the end [s].
        detail: What was seen, e.g. which joint with which value; empty when completed.
        data: Arrays that let a failure be examined, e.g. the infeasible QP.
    """

    outcome: Outcome
    t_s: float
    detail: str = ""
    data: Mapping[str, Array] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "name": self.outcome.name.lower(),
            "sentence": self.outcome.value,
            "t_s": self.t_s,
            "detail": self.detail,
            "data": {name: _plain(value) for name, value in self.data.items()},
        }

    @staticmethod
    def from_dict(plain: Mapping[str, Any]) -> "Ending":
        """Inverse of `to_dict`."""
        return Ending(
            outcome=Outcome[plain["name"].upper()],
            t_s=float(plain["t_s"]),
            detail=str(plain["detail"]),
            data={name: np.array(value, dtype=float) for name, value in plain["data"].items()},
        )


def _plain(values: Array) -> list[Any]:
    """Nested lists with None for what JSON cannot hold."""
    nested = np.asarray(values, dtype=object)
    nested[~np.isfinite(np.asarray(values, dtype=float))] = None
    plain: list[Any] = nested.tolist()
    return plain


@dataclass(frozen=True, kw_only=True)
class TraceMeta:
    """What metrics need to know besides the columns; plain data, stored with the trace.

    Attributes:
        scenario: The resolved scenario.
        control_period_s: Time between rows [s].
        limits: Joint limits: q_min, q_max, velocity, acceleration, torque, and where they are published jerk
            and torque_rate; a number for each joint, SI. Where there are several arms, with the arm's name
            and `_` before them.
        ending: How the run ended.
    """

    scenario: Mapping[str, Any]
    control_period_s: float
    limits: Mapping[str, Sequence[float]]
    ending: Ending

    @property
    def arms(self) -> tuple[str, ...]:
        """Names of the arms where there are several; else none."""
        return tuple(str(arm["name"]) for arm in self.scenario.get("arms", ()))

    @property
    def controller(self) -> str:
        """Name of the controller, or of those of the arms."""
        parts = self.scenario.get("arms", (self.scenario,))
        return joined_names(str(part["controller"]["name"]) for part in parts)

    def of(self, arm: str) -> "TraceMeta":
        """What belongs to the columns of one of several arms, as if it were alone.

        Raises:
            SurgsimError: If there is no such arm, or the scenario does not load in this installation.
        """
        from surgsim.scenario.arms import arms_of  # of no use to a trace of one arm, and takes a while

        whole = arms_of(self.scenario)
        first = f"{arm}_"
        limits = {name: values for name, values in self.limits.items() if name.startswith(first)}
        return replace(
            self,
            scenario=whole.of(arm).resolved(),
            limits={name.removeprefix(first): values for name, values in limits.items()},
        )

    def to_json(self) -> str:
        """The meta data as JSON."""
        return json.dumps(
            {
                "scenario": self.scenario,
                "control_period_s": self.control_period_s,
                "limits": {name: list(values) for name, values in self.limits.items()},
                "ending": self.ending.to_dict(),
            },
            sort_keys=True,
        )

    @staticmethod
    def from_json(text: str) -> "TraceMeta":
        """Inverse of `to_json`.

        Raises:
            ValueError: If the text is not such JSON.
        """
        try:
            data = json.loads(text)
            return TraceMeta(
                scenario=data["scenario"],
                control_period_s=float(data["control_period_s"]),
                limits={name: [float(x) for x in values] for name, values in data["limits"].items()},
                ending=Ending.from_dict(data["ending"]),
            )
        except (KeyError, TypeError, AttributeError) as error:
            raise ValueError(f"damaged trace meta data: {error!r}") from error


class Trace:
    """Columns of a run, read-only: one row per control tick, SI units that the columns' names end with.

    Args:
        data: Rows x columns; copied unless already read-only.
        blocks: The columns, in order.
        meta: What belongs to them.

    Example:
        >>> import surgsim
        >>> trace = surgsim.run("circle_lwr4plus", task={"duration_s": 2.0}).trace
        >>> trace["tip_error_m"].shape, trace.block("tip").shape
        ((3001,), (3001, 3))
    """

    def __init__(self, data: Array, blocks: Sequence[Block], meta: TraceMeta) -> None:
        columns = [name for block in blocks for name in block.columns]
        if data.ndim != 2 or data.shape[1] != len(columns):
            raise ValueError(f"{data.shape} data for {len(columns)} columns")
        self._data = data.copy() if data.flags.writeable else data
        self._data.flags.writeable = False
        self._index = {name: i for i, name in enumerate(columns)}
        self._blocks = {block.name: block for block in blocks}
        self._each: dict[str, Trace] = {}
        self.meta = meta

    def __len__(self) -> int:
        return int(self._data.shape[0])

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of all columns."""
        return tuple(self._index)

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The blocks, in order."""
        return tuple(self._blocks.values())

    @property
    def arms(self) -> tuple[str, ...]:
        """Names of the arms where there are several; else none."""
        return self.meta.arms

    def of(self, arm: str) -> "Trace":
        """The trace of one of several arms, with the columns of a trace of one arm.

        Raises:
            SurgsimError: If there is no such arm.
        """
        if arm not in self.arms:
            raise not_held(arm, "known arm of this trace", self.arms, "its arms")
        if arm not in self._each:
            first = f"{arm}_"
            kept = [b for b in self.blocks if b.name == "t" or b.name.startswith(first)]
            data = np.hstack([self.block(block.name) for block in kept])
            data.flags.writeable = False
            blocks = [replace(block, name=block.name.removeprefix(first)) for block in kept]
            self._each[arm] = Trace(data, blocks, self.meta.of(arm))
        return self._each[arm]

    def each(self) -> "tuple[Trace, ...]":
        """The traces of the arms: of one alone this trace itself."""
        return tuple(self.of(arm) for arm in self.arms) or (self,)

    @property
    def joints(self) -> int:
        """Number of the arm's joints."""
        return len(self.columns_of("q"))

    @property
    def data(self) -> Array:
        """All columns (rows, columns), read-only."""
        return self._data

    def __getitem__(self, column: str) -> Array:
        """One column (rows,).

        Raises:
            UnknownNameError: If there is none of that name.
        """
        try:
            return self._data[:, self._index[column]]
        except (KeyError, TypeError):  # TypeError: not hashable
            raise self._no_column(column) from None

    def __contains__(self, block: str) -> bool:
        """Whether there is a block of that name."""
        return block in self._blocks

    def _no_column(self, name: object) -> UnknownNameError:
        if isinstance(name, str) and name in self._blocks:
            width = len(self.columns_of(name))
            return UnknownNameError(f"'{name}' is a block of {width} columns: ask for block('{name}')")
        return not_held(name, "column of this trace", self._index, "its columns")

    def columns_of(self, block: str) -> tuple[str, ...]:
        """Names of a block's columns.

        Raises:
            UnknownNameError: If there is no such block.
        """
        if block not in self._blocks:
            raise not_held(block, "block of this trace", self._blocks, "its blocks")
        return self._blocks[block].columns

    def block(self, name: str) -> Array:
        """A block's columns (rows, width).

        Raises:
            UnknownNameError: If there is none of that name.
        """
        columns = self.columns_of(name)
        first = self._index[columns[0]]
        return self._data[:, first : first + len(columns)]

    def to_numpy(self) -> Array:
        """A copy of all columns (rows, columns) that may be changed."""
        return self._data.copy()

    def to_dict(self) -> dict[str, Array]:
        """The columns by name, each (rows,), read-only."""
        return {name: self[name] for name in self.columns}

    def to_pandas(self) -> "pd.DataFrame":
        """A data frame of all columns, one row per control tick.

        Raises:
            SurgsimError: If pandas is not installed.
        """
        require("to_pandas needs", "pandas")
        import pandas as pd

        return pd.DataFrame(self.to_numpy(), columns=list(self.columns))

    def __repr__(self) -> str:
        from surgsim.trace.show import as_text

        return as_text(self)

    def _repr_html_(self) -> str:
        from surgsim.trace.show import as_html

        return as_html(self)

    def active(self) -> "Trace":
        """The run itself: this trace without the rows of the stop that followed its outcome."""
        return self._rows(~self._stopped) if self._stopped.any() else self

    def stop(self) -> "Trace":
        """The row at which the run was stopped, and all of the stop that followed; no rows without one."""
        first = len(self) - int(np.count_nonzero(self._stopped))
        return self._rows(np.arange(len(self)) >= (first - 1 if first < len(self) else first))

    @property
    def _stopped(self) -> NDArray[np.bool_]:
        """Which rows belong to the stop (rows,)."""
        told = [name for name in ("stopped", *(f"{arm}_stopped" for arm in self.arms)) if name in self]
        rows = np.array([self[name] == 1.0 for name in told], dtype=bool).reshape(-1, len(self))
        return np.asarray(rows.any(axis=0))

    def _rows(self, mask: NDArray[np.bool_]) -> "Trace":
        return Trace(self._data[mask], self.blocks, self.meta)

    def equals(self, other: "Trace") -> bool:
        """Whether both hold the same experiment bit for bit; machine timings are left out."""
        if self.columns != other.columns or len(self) != len(other):
            return False
        return all(
            np.array_equal(self[name], other[name], equal_nan=True)
            for name in self.columns
            if not name.endswith(TIMING_COLUMNS)
        )
