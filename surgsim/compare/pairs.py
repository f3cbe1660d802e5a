"""Runs of two controllers, paired by scenario, grid point and seed."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from surgsim.compare.observations import COMPLETED, Array, Observations

Key = tuple[str, str, int]


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
        differences: First minus second, for each scenario its units (seeds,).
        wins: Share of a unit's pairs that the first wins, ties counted half, for each scenario (seeds,). A
            failed run loses to a completed one, two failed ones tie.
        mean_a: Mean of the first over the counted pairs, scenarios weighing the same; NaN if there are none.
        mean_b: The same of the second.
        scale: Largest value among the counted pairs.
    """

    count: int
    left_out: Mapping[str, int]
    failed_a: int
    failed_b: int
    differences: tuple[Array, ...]
    wins: tuple[Array, ...]
    mean_a: float
    mean_b: float
    scale: float


def pair_runs(runs: Observations, a: str, b: str, metric: str, lower_is_better: bool | None) -> Pairs:
    """Pair the runs of controllers `a` and `b`."""
    first, second = (_by_key(runs.of_controller(name), metric) for name in (a, b))
    left_out: Counter[str] = Counter()
    failed_a = failed_b = 0
    values: dict[Key, tuple[float, float]] = {}
    wins: dict[Key, float] = {}
    for key in sorted({*first, *second}):
        if key not in first or key not in second:
            left_out[f"run of {a if key not in first else b} missing"] += 1
            continue
        (outcome_a, value_a), (outcome_b, value_b) = first[key], second[key]
        failed_a += outcome_a != COMPLETED
        failed_b += outcome_b != COMPLETED
        reason = _reason(a, b, (outcome_a, value_a), (outcome_b, value_b))
        left_out[reason] += bool(reason)
        if not reason:
            values[key] = (value_a, value_b)
        if "not defined" not in reason:
            wins[key] = _win(
                outcome_a == COMPLETED, value_a, outcome_b == COMPLETED, value_b, lower_is_better
            )
    return Pairs(
        count=len(values),
        left_out={reason: count for reason, count in left_out.items() if count},
        failed_a=failed_a,
        failed_b=failed_b,
        differences=_strata({key: x - y for key, (x, y) in values.items()}),
        wins=_strata(wins),
        mean_a=_mean({key: x for key, (x, _) in values.items()}),
        mean_b=_mean({key: y for key, (_, y) in values.items()}),
        scale=max((abs(x) for pair in values.values() for x in pair), default=0.0),
    )


def _by_key(runs: Observations, metric: str) -> dict[Key, tuple[str, float]]:
    keys = zip(runs.scenario.tolist(), runs.parameters.tolist(), runs.seed.tolist(), strict=True)
    return dict(zip(keys, zip(runs.outcome.tolist(), runs.values(metric).tolist(), strict=True), strict=True))


def _reason(a: str, b: str, run_a: tuple[str, float], run_b: tuple[str, float]) -> str:
    """Why a pair gives no difference; empty if it does."""
    failed = [name for name, (outcome, _) in ((a, run_a), (b, run_b)) if outcome != COMPLETED]
    if len(failed) == 2:
        return "both failed"
    if failed:
        return f"{failed[0]} failed"
    if not np.isfinite([run_a[1], run_b[1]]).all():
        return "metric not defined"
    return ""


def _win(done_a: bool, value_a: float, done_b: bool, value_b: float, lower_is_better: bool | None) -> float:
    """1 if the first is better, 0.5 for a tie, 0 otherwise."""
    if not (done_a and done_b):
        return 0.5 + 0.5 * (done_a - done_b)
    if value_a == value_b or lower_is_better is None:
        return 0.5
    return float((value_a < value_b) == lower_is_better)


def _strata(values: Mapping[Key, float]) -> tuple[Array, ...]:
    """Means over the grid points of each seed, an array for each scenario."""
    units: dict[str, dict[int, list[float]]] = {}
    for (scenario, _, seed), value in sorted(values.items()):
        units.setdefault(scenario, {}).setdefault(seed, []).append(value)
    return tuple(np.array([np.mean(unit) for unit in seeds.values()]) for seeds in units.values())


def _mean(values: Mapping[Key, float]) -> float:
    strata = _strata(values)
    return float(np.mean([stratum.mean() for stratum in strata])) if strata else float("nan")
