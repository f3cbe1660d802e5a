"""Whether a task was done: what every task says of a run once it is over.

A run can come to its end without its task being done: rings lie beside their pegs, goals were given up, or
the tip left its path because a joint was at its limit.
"""

from dataclasses import dataclass
from typing import Protocol

from surgsim.array import Array


class RunColumns(Protocol):
    """A run's rows, by column: what a trace offers."""

    def __len__(self) -> int: ...

    def __contains__(self, block: str) -> bool:
        """Whether there is a block of that name."""
        ...

    def __getitem__(self, column: str) -> Array:
        """One column (rows,)."""
        ...

    def block(self, name: str) -> Array:
        """A block's columns (rows, width)."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Success:
    """Whether a task was done.

    Attributes:
        done: Whether it was; None where that is not defined.
        reason: Why, in a few words, e.g. `2 of 3 rings are on their pegs`.
        needs: Metrics that must also be within the scenario's thresholds for the task to be done.
    """

    done: bool | None
    reason: str
    needs: tuple[str, ...] = ()


PATH_NEEDS = ("tip_error_end_mm", "tip_error_max_mm")
"""What following a path means: the tip stays near it and arrives."""


def path_success(run: RunColumns) -> Success:
    """Success of a task that is a path: it ran to its end, and the tip was never far from it."""
    return Success(done=True, reason="the path was followed", needs=PATH_NEEDS)
