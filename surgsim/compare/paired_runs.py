"""Runs of two controllers, paired by scenario, grid point and seed."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from surgsim.array import Array
from surgsim.compare.observations import Observations, metric_named

Key = tuple[str, str, int]


@dataclass(frozen=True, kw_only=True)
class Run:
    """What a pair needs of a run.

    Attributes:
        standing: 2 where the task was done, 1 where the run only completed, 0 for a failure.
        value: The metric; NaN where it is not defined.
    """

    standing: int
    value: float


@dataclass(frozen=True, kw_only=True)
class Pairs:
    """Pairs of runs that differ in the controller alone.

    A unit is a scenario and a seed: pairs of one seed at several grid points share their random draws, so
    they count once, with their mean.

    Attributes:
        count: Pairs in which both runs completed with a value.
        left_out: Pairs left out of the differences, by reason.
        failed_a: Runs of the first controller that did not complete, among pairs.
        failed_b: The same of the second.
        not_done_a: Runs of the first that completed without doing their task, among pairs.
        not_done_b: The same of the second.
        differences: First minus second, for each scenario its units (seeds,).
        wins: Share of a unit's pairs that the first wins, ties counted half, for each scenario (seeds,). A
            task done beats one that is not, and that a failure. Two failures tie, and so do two values that
            differ by less than matters.
        mean_a: Mean of the first over the counted pairs, scenarios weighing the same; NaN if there are none.
        mean_b: The same of the second.
        scale: Largest value among the counted pairs.
        matters: Smallest difference that matters.
    """

    count: int
    left_out: Mapping[str, int]
    failed_a: int
    failed_b: int
    not_done_a: int
    not_done_b: int
    differences: tuple[Array, ...]
    wins: tuple[Array, ...]
    mean_a: float
    mean_b: float
    scale: float
    matters: float


def pair_runs(runs: Observations, a: str, b: str, metric: str) -> Pairs:
    """Pair the runs of controllers `a` and `b` by `metric`."""
    lower_is_better, matters = metric_named(metric).lower_is_better, runs.matters(metric)
    first, second = (_by_key(runs.of_controller(name), metric) for name in (a, b))
    both = {key: (first[key], second[key]) for key in sorted({*first} & {*second})}
    left_out: Counter[str] = Counter()
    for key in {*first} ^ {*second}:
        left_out[f"run of {a if key not in first else b} missing"] += 1
    reasons = {key: _reason(a, b, *pair) for key, pair in both.items()}
    left_out.update(reason for reason in reasons.values() if reason)
    counted = {key: pair for key, pair in both.items() if not reasons[key]}
    wins = {
        key: win(*pair, lower_is_better, matters)
        for key, pair in both.items()
        if "not defined" not in reasons[key]
    }
    return Pairs(
        count=len(counted),
        left_out=dict(sorted(left_out.items())),
        failed_a=sum(x.standing == 0 for x, _ in both.values()),
        failed_b=sum(y.standing == 0 for _, y in both.values()),
        not_done_a=sum(x.standing == 1 for x, _ in both.values()),
        not_done_b=sum(y.standing == 1 for _, y in both.values()),
        differences=_strata({key: x.value - y.value for key, (x, y) in counted.items()}),
        wins=_strata(wins),
        mean_a=_mean({key: x.value for key, (x, _) in counted.items()}),
        mean_b=_mean({key: y.value for key, (_, y) in counted.items()}),
        scale=max((abs(run.value) for pair in counted.values() for run in pair), default=0.0),
        matters=matters,
    )


def _by_key(runs: Observations, metric: str) -> dict[Key, Run]:
    keys = zip(runs.scenario.tolist(), runs.parameters.tolist(), runs.seed.tolist(), strict=True)
    found = zip(runs.standing.tolist(), runs.values(metric).tolist(), strict=True)
    return {key: Run(standing=s, value=x) for key, (s, x) in zip(keys, found, strict=True)}


def _reason(a: str, b: str, run_a: Run, run_b: Run) -> str:
    """Why a pair gives no difference; empty if it does."""
    failed = [name for name, run in ((a, run_a), (b, run_b)) if run.standing == 0]
    if len(failed) == 2:
        return "both failed"
    if failed:
        return f"{failed[0]} failed"
    if not np.isfinite([run_a.value, run_b.value]).all():
        return "metric not defined"
    return ""


def win(a: Run, b: Run, lower_is_better: bool | None, matters: float = 0.0) -> float:
    """1 if `a` is better, 0.5 for a tie, 0 otherwise."""
    if a.standing != b.standing:
        return float(a.standing > b.standing)
    difference = a.value - b.value
    if a.standing == 0 or lower_is_better is None or difference == 0.0 or abs(difference) < matters:
        return 0.5
    return float((difference < 0.0) == lower_is_better)


def _strata(values: Mapping[Key, float]) -> tuple[Array, ...]:
    """Means over the grid points of each seed, an array for each scenario."""
    units: dict[str, dict[int, list[float]]] = {}
    for (scenario, _, seed), value in sorted(values.items()):
        units.setdefault(scenario, {}).setdefault(seed, []).append(value)
    return tuple(np.array([np.mean(unit) for unit in seeds.values()]) for seeds in units.values())


def _mean(values: Mapping[Key, float]) -> float:
    strata = _strata(values)
    return float(np.mean([stratum.mean() for stratum in strata])) if strata else float("nan")
