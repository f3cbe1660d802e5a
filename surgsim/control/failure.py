"""A controller that has no answer."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from surgsim.errors import Outcome
from surgsim.tick.status import DIVERGED, INFEASIBLE, RANK_LOST

Array = NDArray[np.float64]
_OUTCOMES = {
    INFEASIBLE: Outcome.INFEASIBLE,
    RANK_LOST: Outcome.INFEASIBLE,
    DIVERGED: Outcome.DIVERGED,
}
_DETAILS = {
    INFEASIBLE: "no command meets the hard constraints",
    RANK_LOST: "the task Jacobian has lost rank",
    DIVERGED: "a state of the controller has grown past all bounds",
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
    status: int, details: Mapping[int, str], data: Mapping[str, Array] | None = None
) -> ControlFailure:
    """The failure that a kernel's `status` stands for, in the part's own words where it has some."""
    return ControlFailure(_OUTCOMES[status], details.get(status, _DETAILS[status]), data)
