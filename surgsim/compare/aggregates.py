"""Figures over scenarios: normalised scores, interquartile means, performance profiles, mean ranks.

After Agarwal et al., Deep RL at the Edge of the Statistical Precipice, NeurIPS 2021 (interquartile mean,
stratified bootstrap, performance profile), with the scores of Dolan and Moré, Math. Programming 91, 2002
(ratio to the best). A failed run has no score: it is counted, never averaged; profiles and ranks put it last.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from surgsim.array import Array
from surgsim.compare.intervals import (
    NOTHING,
    RESAMPLES,
    Interval,
    percentile,
    resampled,
    same,
    too_few,
)
from surgsim.compare.intervals import SEEDS_DO_NOT_MATTER as CONSTANT
from surgsim.compare.observations import Observations, Texts, metric_named


def scores(runs: Observations, metric: str) -> Array:
    """Scores (n,): 1 is the typical run of the setting's best controller, larger is worse.

    A setting is a scenario and a grid point; its reference r is the best of the controllers' medians. A value
    that differs from r by less than m, the smallest difference that matters, scores 1. Where all values of
    the metric are positive the others score x/max(r, m) (r/x if more is better), otherwise 1 + |x - r|/d,
    signed so that larger is worse, with d the larger of m and the setting's interquartile range. NaN for a
    failed run.
    """
    values, lower = runs.values(metric), metric_named(metric).lower_is_better
    ratio = bool(np.nanmin(values) > 0.0) if np.isfinite(values).any() else True
    found, matters = np.full(len(runs), np.nan), runs.matters(metric)
    settings = _groups(runs.scenario, runs.parameters)
    for rows in settings.values():
        medians = _medians(values[rows], runs.controller[rows])
        if medians.size:
            best = float(medians.max() if lower is False else medians.min())
            scored = _score(values[rows], best, lower is not False, ratio, matters)
            found[rows] = np.where(np.abs(values[rows] - best) < matters, 1.0, scored)
    return found


def _score(values: Array, best: float, lower_is_better: bool, ratio: bool, matters: float) -> Array:
    if ratio:
        return values / max(best, matters) if lower_is_better else best / values
    spread = float(np.subtract(*np.nanpercentile(values, [75, 25]))) or float(
        np.nanmax(values) - np.nanmin(values)
    )
    worse = values - best if lower_is_better else best - values
    return np.asarray(1.0 + worse / (max(spread, matters) or 1.0))


def _medians(values: Array, controllers: Texts) -> Array:
    groups = [values[rows] for rows in _groups(controllers).values()]
    return np.array([np.nanmedian(group) for group in groups if np.isfinite(group).any()])


def _groups(*labels: Iterable[str]) -> dict[tuple[str, ...], list[int]]:
    """Rows of each combination of labels, in order of appearance."""
    groups: dict[tuple[str, ...], list[int]] = {}
    for row, key in enumerate(zip(*labels, strict=True)):
        groups.setdefault(key, []).append(row)
    return groups


def by_seed(runs: Observations, values: Array) -> list[Array]:
    """`values` as one array (seeds, grid points) for each scenario, NaN where there is none."""
    strata = []
    for _, rows in sorted(_groups(runs.scenario).items()):
        seeds, i = np.unique(runs.seed[rows], return_inverse=True)
        points, j = np.unique(runs.parameters[rows].astype(str), return_inverse=True)
        block = np.full((seeds.size, points.size), np.nan)
        block[i, j] = values[rows]
        strata.append(block)
    return strata


def interquartile_mean(samples: Array) -> Array:
    """Mean of the middle half along the last axis, NaN left out; as `scipy.stats.trim_mean(x, 0.25)`."""
    ordered = np.sort(samples, axis=-1)  # NaN last
    count = np.isfinite(ordered).sum(axis=-1)
    cut = count // 4
    place = np.arange(ordered.shape[-1])
    middle = (place >= cut[..., None]) & (place < (count - cut)[..., None])
    total = np.where(middle, ordered, 0.0).sum(axis=-1)
    kept = count - 2 * cut
    mean: Array = np.divide(total, kept, out=np.full(total.shape, np.nan), where=kept > 0)
    return mean


def iqm_interval(runs: Observations, values: Array, name: str, resamples: int = RESAMPLES) -> Interval:
    """Interquartile mean of `values` over runs that have one, with its interval."""
    return _interval(by_seed(runs, values), interquartile_mean, f"iqm {name}", resamples)


def _interval(
    strata: Sequence[Array], statistic: Callable[[Array], Array], name: str, resamples: int
) -> Interval:
    """`statistic` of all runs with the expanded percentile interval of stratified resamples."""
    used = [stratum[np.isfinite(stratum).any(axis=1)] for stratum in strata]
    used = [stratum for stratum in used if len(stratum)]
    sizes = [len(stratum) for stratum in used]
    if not used:
        return Interval(value=None, note=NOTHING)
    value = float(statistic(np.concatenate([stratum.ravel() for stratum in used])[None])[0])
    note = too_few(sizes)
    if not note and all(_constant(stratum) for stratum in used):
        note = CONSTANT
    if note:
        return Interval(value=value, n=sum(sizes), note=note)
    low, high = percentile(resampled(used, statistic, name, resamples), sizes)
    return Interval(value=value, low=low, high=high, n=sum(sizes))


def _constant(stratum: Array) -> bool:
    """Whether the seeds (rows) of a stratum all give the same."""
    return all(same(column[np.isfinite(column)], 0.0) for column in stratum.T)


def ranks(runs: Observations, metric: str) -> Array:
    """Rank of each run among the controllers at its scenario, grid point and seed (n,); 1 is best.

    A task done comes before one that is not, and that before a failure. Within the same, a value is better
    if it is so by the smallest difference that matters. The rank is one, plus the better ones, plus half of
    the ties: with exact ties alone, their mean rank. NaN where a controller is missing or a completed run has
    no value, because ranks among fewer mean something else.
    """
    lower = metric_named(metric).lower_is_better
    values, completed, standing = runs.values(metric), runs.completed, runs.standing
    size, matters = len(runs.controllers), runs.matters(metric)
    found = np.full(len(runs), np.nan)
    for rows in _groups(runs.scenario, runs.parameters, [str(seed) for seed in runs.seed]).values():
        whole = len(rows) == size and np.isfinite(values[rows])[completed[rows]].all()
        if whole and completed[rows].any():
            oriented = values[rows] if lower is not False else -values[rows]
            found[rows] = _ranks(np.where(completed[rows], oriented, 0.0), standing[rows], matters)
    return found


def _ranks(values: Array, standing: NDArray[np.int64], matters: float) -> Array:
    """Ranks of runs that differ in the controller (n,), the less the better."""
    less = values[:, None] - values[None, :]
    lead = standing[:, None] - standing[None, :]
    ahead = (lead > 0) | ((lead == 0) & (less < 0.0) & (less <= -matters))  # [i, j]: i before j
    before = ahead.sum(axis=0)
    ties = len(values) - 1 - before - ahead.sum(axis=1)
    return np.asarray(1.0 + before + 0.5 * ties)


def _mean(samples: Array) -> Array:
    return np.asarray(np.nanmean(samples, axis=-1))


def mean_rank(runs: Observations, rank: Array, name: str, resamples: int = RESAMPLES) -> Interval:
    """Mean of ranks over scenarios, grid points and seeds, with its interval."""
    return _interval(by_seed(runs, rank), _mean, f"rank {name}", resamples)


@dataclass(frozen=True, kw_only=True)
class Profile:
    """A performance profile.

    Attributes:
        fraction: Share of all runs with a score of at most tau (taus,); what has no score never counts.
        low: Lower end of the interval at each tau (taus,); equal to `fraction` without an interval.
        high: Upper end (taus,).
    """

    fraction: Array
    low: Array
    high: Array


def performance_profile(runs: Observations, score: Array, taus: Array, resamples: int = 500) -> Profile:
    """Profile of one controller's `runs` with their scores (n,)."""
    strata = by_seed(runs, np.where(np.isfinite(score), score, np.inf))

    def share(samples: Array) -> Array:
        """(resamples, runs) to (resamples, taus); NaN marks a run that was not made."""
        ordered = np.sort(samples, axis=-1)
        made = np.isfinite(ordered).sum(-1) + np.isinf(ordered).sum(-1)
        below = np.array([np.searchsorted(row, taus, side="right") for row in ordered])
        return np.asarray(below / made[:, None])

    fraction = share(np.concatenate([stratum.ravel() for stratum in strata])[None])[0]
    if too_few([len(stratum) for stratum in strata]):
        return Profile(fraction=fraction, low=fraction, high=fraction)
    draws = resampled(strata, share, "profile", resamples)
    low, high = np.quantile(draws, [0.025, 0.975], axis=0)
    return Profile(fraction=fraction, low=low, high=high)
