"""Two controllers compared: paired by seed, with an interval, and a verdict in words.

The probability of improvement is that of Agarwal et al., Deep RL at the Edge of the Statistical Precipice,
NeurIPS 2021, but within pairs and with failures as losses. Their package `rliable` (1.2.0) does not import
with pandas 3 and knows neither pairs nor failures, so the formulas are here.
"""

import enum
import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from surgsim.compare.intervals import (
    NOTHING,
    SEEDS_DO_NOT_MATTER,
    Interval,
    mean_interval,
    proportion_interval,
)
from surgsim.compare.observations import Observations, metric_named
from surgsim.compare.pairs import Pairs, pair_runs
from surgsim.compare.wording import bracket, counted, number, unit_of
from surgsim.metrics.metric import Metric


class Verdict(enum.Enum):
    """What a comparison found."""

    BETTER = "better"
    WORSE = "worse"
    NO_DIFFERENCE = "no difference detected"
    EQUAL = "equal"
    DIFFERENT = "different, and the metric has no better side"
    TOO_FEW = "too few pairs"


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Controller `a` against `b` by one metric.

    Attributes:
        a: The first controller.
        b: The second.
        metric: Name of the metric.
        scenario: The scenario, or None for all of them, each weighing the same.
        pairs: Pairs in which both completed with a value.
        left_out: Pairs left out, by reason.
        failed_a: Runs of `a` that failed, among pairs.
        failed_b: Runs of `b` that failed, among pairs.
        mean_a: Mean of `a` over the pairs; None if there are none.
        mean_b: Mean of `b` over the pairs; None if there are none.
        difference: Mean of a - b with its interval; `n` counts seeds in every scenario.
        improvement: Probability that `a` is better than `b` with the same seed; failures lose.
        verdict: What was found, of `a`.
        sentence: The same in words, with the figures.
    """

    a: str
    b: str
    metric: str
    scenario: str | None
    pairs: int
    left_out: Mapping[str, int]
    failed_a: int
    failed_b: int
    mean_a: float | None
    mean_b: float | None
    difference: Interval
    improvement: Interval
    verdict: Verdict
    sentence: str


def compare_pair(runs: Observations, a: str, b: str, metric: str, scenario: str | None = None) -> Comparison:
    """Compare controllers `a` and `b` by `metric`, in one scenario or over all.

    Raises:
        SurgsimError: If the metric is unknown.
    """
    spec = metric_named(metric)
    pairs = pair_runs(
        runs if scenario is None else runs.of_scenario(scenario), a, b, metric, spec.lower_is_better
    )
    difference = mean_interval(pairs.differences, scale=pairs.scale)
    verdict = _verdict(spec, difference, pairs.scale)
    return Comparison(
        a=a,
        b=b,
        metric=metric,
        scenario=scenario,
        pairs=pairs.count,
        left_out=pairs.left_out,
        failed_a=pairs.failed_a,
        failed_b=pairs.failed_b,
        mean_a=pairs.mean_a if pairs.count else None,
        mean_b=pairs.mean_b if pairs.count else None,
        difference=difference,
        improvement=_improvement(spec, pairs, difference),
        verdict=verdict,
        sentence=_sentence(a, b, spec, pairs, difference, verdict),
    )


def compare_all(
    runs: Observations, metric: str, scenario: str | None = None, most: int | None = None
) -> list[Comparison]:
    """Every controller against every other, in order of appearance; `most` takes the first ones only."""
    couples = itertools.combinations(runs.controllers[:most], 2)
    return [compare_pair(runs, a, b, metric, scenario) for a, b in couples]


def _verdict(metric: Metric, difference: Interval, scale: float) -> Verdict:
    value, low, high = difference.value, difference.low, difference.high
    if value is None or (difference.note and difference.note != SEEDS_DO_NOT_MATTER):
        return Verdict.TOO_FEW
    if difference.note:
        low = high = value if abs(value) > 1e-12 * scale else 0.0
        if low == 0.0:
            return Verdict.EQUAL
    if low is None or high is None or low <= 0.0 <= high:
        return Verdict.NO_DIFFERENCE
    if metric.lower_is_better is None:
        return Verdict.DIFFERENT
    return Verdict.BETTER if (value < 0.0) == metric.lower_is_better else Verdict.WORSE


def _improvement(metric: Metric, pairs: Pairs, difference: Interval) -> Interval:
    """Mean over scenarios of the share of pairs that `a` wins."""
    n = sum(stratum.size for stratum in pairs.wins)
    if n == 0 or metric.lower_is_better is None:
        return Interval(value=None, note=NOTHING)
    share = float(np.mean([stratum.mean() for stratum in pairs.wins]))
    alike = all(np.ptp(stratum) == 0.0 for stratum in pairs.wins)
    if difference.note == SEEDS_DO_NOT_MATTER and alike:
        return Interval(value=share, n=n, note=SEEDS_DO_NOT_MATTER)
    return proportion_interval(share, n)


def _sentence(a: str, b: str, metric: Metric, pairs: Pairs, difference: Interval, verdict: Verdict) -> str:
    """The verdict in words; failures are said in every case."""
    failures = ""
    if pairs.failed_a or pairs.failed_b:
        failures = f" Failed: {a} {pairs.failed_a}, {b} {pairs.failed_b} of {_of(pairs)} pairs."
    return _finding(a, b, metric, pairs, difference, verdict) + failures


def _finding(a: str, b: str, metric: Metric, pairs: Pairs, difference: Interval, verdict: Verdict) -> str:
    if verdict is Verdict.TOO_FEW:
        if not pairs.count:
            return f"Too few pairs: none ({counted(pairs.left_out) or 'no runs'})."
        return f"Too few pairs: {difference.note.removesuffix(': no interval')}."
    if verdict is Verdict.EQUAL:
        return f"No difference: {a} and {b} give the same value with every seed."
    unit = f" {unit_of(metric.name)}".rstrip()
    if verdict is Verdict.NO_DIFFERENCE:
        return f"No difference detected: {number(difference.value)} {bracket(difference)}{unit}."
    value = difference.value or 0.0
    size = f"{number(abs(value))}{unit}{_relative(pairs)}"
    by = f"{size}, seeds do not matter" if difference.note else f"{size} {_absolute(difference)}"
    by += _unless(pairs, value)
    if verdict is Verdict.DIFFERENT:
        return f"{a} is {'lower' if value < 0 else 'higher'} than {b} by {by}."
    return f"{a} is {verdict.value} than {b} by {by}."


def _unless(pairs: Pairs, value: float) -> str:
    """In how many scenarios the difference goes the other way, or is none."""
    other = sum(stratum.mean() * value <= 0.0 for stratum in pairs.differences)
    return f", but not in {other} of {len(pairs.differences)} scenarios" if other else ""


def _absolute(difference: Interval) -> str:
    """Interval of the difference's size: an interval that excludes 0 loses its sign."""
    ends = sorted(abs(end) for end in (difference.low, difference.high) if end is not None)
    return bracket(Interval(value=None, low=ends[0], high=ends[-1]))


def _relative(pairs: Pairs) -> str:
    """The difference in percent of `b`, where that says something."""
    if not (pairs.mean_b > 0.0 and pairs.mean_a > 0.0):
        return ""
    change = 100.0 * (pairs.mean_a / pairs.mean_b - 1.0)
    return f" ({change:+.0f} %)".replace("-", "−") if 1.0 <= abs(change) <= 1000.0 else ""


def _of(pairs: Pairs) -> int:
    missing = sum(count for reason, count in pairs.left_out.items() if reason.endswith("missing"))
    return pairs.count + sum(pairs.left_out.values()) - missing
