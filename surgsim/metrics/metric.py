"""What a metric is."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from surgsim.trace.trace import Trace


@dataclass(frozen=True, kw_only=True)
class Source:
    """Where a smallest difference that matters comes from.

    Attributes:
        kind: `clinical` and `instrument` are published figures of surgeons and of arms; `choice` is this
            project's own, for want of one; `none`: every difference counts.
        text: What the figure is, in words.
        reference: Where it was published; empty for a choice.
    """

    kind: Literal["clinical", "instrument", "choice", "none"]
    text: str
    reference: str = ""

    def __str__(self) -> str:
        return f"{self.text} ({self.reference})" if self.reference else self.text


REPEATABILITY = Source(
    kind="instrument",
    text="how well the arms come back to a pose",
    reference="ISO 9283; data sheets: 0.05 and 0.1 mm",
)
STEADY_HAND = Source(
    kind="clinical",
    text="how still surgeons hold an instrument (0.05 to 0.13 mm RMS), and how well arms come back to a pose",
    reference="Riviere, Rader and Khosla 1997; ISO 9283, data sheets: 0.05 and 0.1 mm",
)
FORCE_RESOLUTION = Source(
    kind="instrument",
    text="the force resolution of a torque-controlled arm, a fifth of the least friction of a trocar's seal",
    reference="data sheet: 0.05 N; doi 10.1177/0954411915576769: 0.25 to 8 N",
)
PEG_TRANSFER_SECOND = Source(
    kind="clinical",
    text="a second of the peg transfer of laparoscopic training, over its twelve transfers",
    reference="Fundamentals of Laparoscopic Surgery: timed in seconds, proficient in 48 s",
)
CHOICE = Source(kind="choice", text="a choice of this project")
ANY = Source(kind="none", text="any difference counts")


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
            ones are ties in ranks, and it is the margin of equivalence in comparisons. A suite or the command
            line can say another.
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
    matters_source: Source = ANY


def with_block(block: str, compute: Callable[[Trace], float], rows: int = 1) -> Callable[[Trace], float]:
    """`compute`, for traces with that block and so many rows; NaN for the others."""

    def value(trace: Trace) -> float:
        return compute(trace) if block in trace and len(trace) >= rows else math.nan

    return value
