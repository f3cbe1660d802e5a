"""What a comparison of two controllers found."""

import enum

from surgsim.compare.intervals import SEEDS_DO_NOT_MATTER, Interval
from surgsim.metrics.metric import Metric


class Verdict(enum.Enum):
    """What was found of the first controller against the second."""

    BETTER = "better"
    WORSE = "worse"
    PERHAPS = "different, but perhaps by less than matters"
    NOT_TOLD_APART = "not told apart"
    EQUIVALENT = "equivalent"
    EQUAL = "equal"
    DIFFERENT = "different, and the metric has no better side"
    TOO_FEW = "too few pairs"


def verdict_of(metric: Metric, difference: Interval, scale: float, matters: float) -> Verdict:
    """The verdict on a difference, first less second.

    With m the smallest difference that matters, which is the margin of equivalence: equivalent if the whole
    interval lies inside (-m, m), a difference if the whole interval lies on one side of both 0 and m. With a
    95 % interval the first is the two one-sided tests, each at 2.5 %. An interval that holds 0 and reaches m
    says neither: the two are not told apart, which is no finding that they are alike.

    Source: Schuirmann, J. Pharmacokinetics and Biopharmaceutics 15, 1987 (two one-sided tests).

    Args:
        metric: Says which side is better.
        difference: The difference with its interval.
        scale: Size of the numbers that it is a difference of, to tell rounding from a difference.
        matters: m, in the metric's unit.
    """
    value, low, high = difference.value, difference.low, difference.high
    if value is None or (difference.note and difference.note != SEEDS_DO_NOT_MATTER):
        return Verdict.TOO_FEW
    if difference.note:
        low = high = value
        if abs(value) <= 1e-12 * scale:
            return Verdict.EQUAL
    if low is None or high is None:
        return Verdict.NOT_TOLD_APART
    if max(abs(low), abs(high)) < matters:
        return Verdict.EQUIVALENT
    if low <= 0.0 <= high:
        return Verdict.NOT_TOLD_APART
    if metric.lower_is_better is None:
        return Verdict.DIFFERENT
    if min(abs(low), abs(high)) < matters:
        return Verdict.PERHAPS
    return Verdict.BETTER if (value < 0.0) == metric.lower_is_better else Verdict.WORSE
