"""What a metric is."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from surgsim.trace.trace import Trace

REPEATABILITY = "how well the arms come back to a pose (ISO 9283; data sheets: 0.05 and 0.1 mm)"
FORCE_RESOLUTION = "the force resolution of a torque-controlled arm (data sheet: 0.05 N)"
CHOICE = "a choice of this project"


class Undefined(Exception):
    """A metric has no value for a run, for a reason that a person is told."""


@dataclass(frozen=True, kw_only=True)
class Metric:
    """A named figure of a run.

    Attributes:
        name: Name with its unit suffix, as in `metrics.json`.
        heading: What tables and figures call it: words, and the unit in brackets.
        meaning: One line for a person.
        compute: Value from a trace; NaN where the trace does not define it, `Undefined` with a reason.
        lower_is_better: Direction for rankings; None where there is none.
        whole: Whether it is of the whole trace, and not of the run without the stop after its outcome.
        digits: Significant digits worth printing.
        matters: Smallest difference of two values that matters, in the metric's unit; 0: any does. Smaller
            ones are ties in comparisons and ranks. A suite or the command line can say another.
        matters_source: Where that comes from.
    """

    name: str
    heading: str
    meaning: str
    compute: Callable[[Trace], float]
    lower_is_better: bool | None = True
    whole: bool = False
    digits: int = 4
    matters: float = 0.0
    matters_source: str = "any difference counts"


def with_block(block: str, compute: Callable[[Trace], float], rows: int = 1) -> Callable[[Trace], float]:
    """`compute`, for traces with that block and so many rows; NaN for the others."""

    def value(trace: Trace) -> float:
        return compute(trace) if block in trace and len(trace) >= rows else math.nan

    return value
