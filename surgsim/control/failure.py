"""A controller that has no answer."""

from collections.abc import Callable, Mapping
from typing import Any

from surgsim.array import Array
from surgsim.errors import Outcome
from surgsim.tick.status import DIVERGED, EXTERNAL, INFEASIBLE, RANK_LOST

Words = str | Callable[[Any], str]
"""What a status means: words, or a function of what the kernel saw."""
_OUTCOMES = {
    INFEASIBLE: Outcome.INFEASIBLE,
    RANK_LOST: Outcome.INFEASIBLE,
    DIVERGED: Outcome.DIVERGED,
    EXTERNAL: Outcome.EXTERNAL_FAILED,
}
_DETAILS = {
    INFEASIBLE: "no command meets the hard constraints",
    RANK_LOST: "the task Jacobian has lost rank",
    DIVERGED: "a state of the controller has grown past all bounds",
    EXTERNAL: "the external controller gave no answer",
}


class ControlFailure(Exception):
    """The controller cannot give a command: the run ends with this outcome.

    Attributes:
        outcome: How the run ends.
        detail: What the controller saw, for the person who looks into it.
        data: Arrays that let the failure be examined, e.g. the infeasible QP.
    """

    def __init__(self, outcome: Outcome, detail: str, data: Mapping[str, Array] | None = None) -> None:
        self.outcome = outcome
        self.detail = detail
        self.data = dict(data or {})
        super().__init__(detail)


def failure_of(
    status: int, details: Mapping[int, Words], data: Mapping[str, Array] | None = None, seen: Any = None
) -> ControlFailure:
    """The failure that a kernel's `status` stands for, in the part's own words where it has some."""
    words = details.get(status, _DETAILS[status])
    return ControlFailure(_OUTCOMES[status], words if isinstance(words, str) else words(seen), data)
