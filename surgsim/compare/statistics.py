"""Two controllers compared: paired by seed, with an interval, and a verdict in words.

The probability of improvement is that of Agarwal et al., Deep RL at the Edge of the Statistical Precipice,
NeurIPS 2021, but within pairs and with failures as losses. Their package `rliable` (1.2.0) does not import
with pandas 3 and knows neither pairs nor failures, so the formulas are here.
"""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import bdtr  # scipy.stats takes a second to import

from surgsim.compare.intervals import (
    NOTHING,
    SEEDS_DO_NOT_MATTER,
    Interval,
    mean_interval,
    proportion_interval,
)
from surgsim.compare.observations import Observations, metric_named
from surgsim.compare.paired_runs import Pairs, pair_runs
from surgsim.compare.sentences import sentence_of
from surgsim.compare.verdict import Verdict, verdict_of
from surgsim.metrics.metric import Metric


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Controller `a` against `b` by one metric.

    Attributes:
        a: The first controller.
        b: The second.
        metric: Name of the metric.
        scenario: The scenario, or None for all of them, each weighing the same.
        pairs: Pairs in which both completed with a value.
        seeds: Seeds of these pairs in each scenario.
        left_out: Pairs left out, by reason.
        failed_a: Runs of `a` that failed, among pairs.
        failed_b: Runs of `b` that failed, among pairs.
        not_done_a: Runs of `a` that completed without doing their task, among pairs.
        not_done_b: The same of `b`.
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
    seeds: tuple[int, ...]
    left_out: Mapping[str, int]
    failed_a: int
    failed_b: int
    not_done_a: int
    not_done_b: int
    mean_a: float | None
    mean_b: float | None
    difference: Interval
    improvement: Interval
    verdict: Verdict
    sentence: str


def chance_of_failures(found: Comparison) -> float:
    """Probability of failures as unequal as these, or more so, if both controllers failed alike.

    The exact test of McNemar: of the pairs in which one alone failed, each is as likely to be either's.
    """
    alone = [found.left_out.get(f"{name} failed", 0) for name in (found.a, found.b)]
    return min(1.0, 2.0 * float(bdtr(min(alone), sum(alone), 0.5)))


def compare_pair(runs: Observations, a: str, b: str, metric: str, scenario: str | None = None) -> Comparison:
    """Compare controllers `a` and `b` by `metric`, in one scenario or over all.

    Raises:
        SurgsimError: If the metric is unknown.
    """
    spec = metric_named(metric)
    pairs = pair_runs(runs if scenario is None else runs.of_scenario(scenario), a, b, metric)
    difference = mean_interval(pairs.differences, scale=pairs.scale)
    verdict = verdict_of(spec, difference, pairs.scale, pairs.matters)
    return Comparison(
        a=a,
        b=b,
        metric=metric,
        scenario=scenario,
        pairs=pairs.count,
        seeds=tuple(stratum.size for stratum in pairs.differences),
        left_out=pairs.left_out,
        failed_a=pairs.failed_a,
        failed_b=pairs.failed_b,
        not_done_a=pairs.not_done_a,
        not_done_b=pairs.not_done_b,
        mean_a=pairs.mean_a if pairs.count else None,
        mean_b=pairs.mean_b if pairs.count else None,
        difference=difference,
        improvement=_improvement(spec, pairs, difference),
        verdict=verdict,
        sentence=sentence_of(a, b, spec, pairs, difference, verdict),
    )


def compare_all(
    runs: Observations, metric: str, scenario: str | None = None, most: int | None = None
) -> list[Comparison]:
    """Every controller against every other, in order of appearance; `most` takes the first ones only."""
    couples = itertools.combinations(runs.controllers[:most], 2)
    return [compare_pair(runs, a, b, metric, scenario) for a, b in couples]


def _improvement(metric: Metric, pairs: Pairs, difference: Interval) -> Interval:
    """Mean over scenarios of the share of pairs that `a` wins."""
    sizes = [stratum.size for stratum in pairs.wins]
    if not sizes or metric.lower_is_better is None:
        return Interval(value=None, note=NOTHING)
    share = float(np.mean([stratum.mean() for stratum in pairs.wins]))
    alike = all(np.ptp(stratum) == 0.0 for stratum in pairs.wins)
    if difference.note == SEEDS_DO_NOT_MATTER and alike:
        return Interval(value=share, n=sum(sizes), note=SEEDS_DO_NOT_MATTER)
    return proportion_interval(share, sizes)
