"""Intervals that say how far a figure would move with other seeds.

Runs are resampled within each scenario (strata): the scenarios of a suite are chosen, its seeds are drawn.
The random numbers are seeded from the data themselves, so the same data always give the same interval.

How often they cover the truth is measured by `benchmarks/interval_coverage.py`; the table is in
`docs/statistics.md`.

Sources: Efron and Tibshirani, An Introduction to the Bootstrap, 1993, section 12.5 (bootstrap-t); Hesterberg,
The American Statistician 69, 2015 (expanded percentile interval); Wilson, JASA 22, 1927.
"""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri, stdtrit

from surgsim.array import Array

LEVEL = 0.95
RESAMPLES = 2000
FEWEST = 5
"""Fewer seeds than this give a figure without an interval."""

ONE_SEED = "one seed: no interval"
SEEDS_DO_NOT_MATTER = "every seed gives the same: no interval"
NOTHING = "no value"
_WHOLE = 0.95


@dataclass(frozen=True, kw_only=True)
class Interval:
    """A figure and its 95 % interval.

    Attributes:
        value: The figure; None if there is nothing to take it of.
        low: Lower end; None without an interval.
        high: Upper end; None without an interval, or where it is open.
        n: Independent seeds, counted in every scenario, that it rests on.
        note: Why there is no interval, or why it is open above; empty if there is one.
    """

    value: float | None
    low: float | None = None
    high: float | None = None
    n: int = 0
    note: str = ""


def rng_of(*identity: str | Array) -> np.random.Generator:
    """Random numbers that depend on `identity` alone."""
    digest = hashlib.sha256()
    for part in identity:
        digest.update(part.encode() if isinstance(part, str) else np.ascontiguousarray(part).tobytes())
        digest.update(b"\0")
    return np.random.default_rng(int.from_bytes(digest.digest()[:16], "little"))


def too_few(sizes: Sequence[int]) -> str:
    """Why strata of these `sizes` allow no interval; empty if they do."""
    n = sum(sizes)
    if n == 0:
        return NOTHING
    if max(sizes) == 1:
        return ONE_SEED
    if n < FEWEST:
        over = f" over {len(sizes)} scenarios" if len(sizes) > 1 else ""
        return f"only {n} seeds{over}: no interval"
    return "a scenario has only one seed: no interval" if min(sizes) < 2 else ""


def same(values: Array, scale: float) -> bool:
    """Whether `values` are all equal but for rounding at the size of `scale`."""
    return values.size == 0 or float(np.ptp(values)) <= 1e-12 * max(scale, float(np.max(np.abs(values))))


def mean_interval(strata: Sequence[Array], *, scale: float = 0.0) -> Interval:
    """Mean over strata of their means, with the bootstrap-t interval.

    The interval is m - t* s with the quantiles of t* = (m* - m)/s* over resamples, and s^2 the sum of
    s_k^2/n_k over the K strata, divided by K^2. With few seeds and skewed data, the percentile and BCa
    intervals are too short.

    Args:
        strata: Values of each scenario, one array each.
        scale: Size of the numbers that the values are differences of, to tell rounding from a difference.
    """
    full = [stratum for stratum in strata if stratum.size]
    sizes = [stratum.size for stratum in full]
    n = sum(sizes)
    value = float(np.mean([stratum.mean() for stratum in full])) if full else None
    note = too_few(sizes)
    if not note and all(same(stratum, scale) for stratum in full):
        note = SEEDS_DO_NOT_MATTER
    if note:
        return Interval(value=value, n=n, note=note)
    low, high = _bootstrap_t(full)
    return Interval(value=value, low=low, high=high, n=n)


def _bootstrap_t(strata: Sequence[Array]) -> tuple[float, float]:
    rng = rng_of("bootstrap-t", *strata)
    means, variances = np.zeros(RESAMPLES), np.zeros(RESAMPLES)
    for x in strata:
        drawn = x[rng.integers(0, x.size, (RESAMPLES, x.size))]
        means += drawn.mean(axis=1) / len(strata)
        variances += drawn.var(axis=1, ddof=1) / x.size / len(strata) ** 2
    mean = float(np.mean([x.mean() for x in strata]))
    error = float(np.sqrt(sum(x.var(ddof=1) / x.size for x in strata))) / len(strata)
    spread = np.sqrt(variances)
    usable = spread > 1e-9 * error
    if usable.mean() < _WHOLE:  # mostly ties: t* has no distribution to speak of
        return percentile(means, [x.size for x in strata])
    low, high = np.quantile((means - mean)[usable] / spread[usable], [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return float(mean - high * error), float(mean - low * error)


def resampled(
    strata: Sequence[Array], statistic: Callable[[Array], Array], name: str, resamples: int = RESAMPLES
) -> Array:
    """`statistic` of stratified resamples.

    Args:
        strata: Runs of each scenario (seeds, runs of a seed), NaN where there is no value.
        statistic: From samples (resamples, runs) to figures (resamples, ...).
        name: What the figure is, to seed the random numbers.
        resamples: How many.
    """
    rng = rng_of(name, *strata)
    drawn = []
    for x in strata:
        rows = x[rng.integers(0, len(x), (resamples, len(x)))]
        drawn.append(rows.reshape(resamples, -1))
    return statistic(np.hstack(drawn))


def percentile(figures: Array, sizes: Sequence[int]) -> tuple[float, float]:
    """Percentile interval of resampled `figures`, expanded for few seeds.

    The tails are cut at Phi(-sqrt(n/(n-1)) t_(n-1)) instead of 2.5 %, n the mean size of the strata and the
    degrees of freedom counted over all of them: exact for the mean of normal data.
    """
    per_stratum, freedom = float(np.mean(sizes)), sum(sizes) - len(sizes)
    t = stdtrit(freedom, (1 + LEVEL) / 2)
    tail = float(ndtr(-np.sqrt(per_stratum / (per_stratum - 1)) * t))
    low, high = np.quantile(figures[np.isfinite(figures)], [tail, 1 - tail])
    return float(low), float(high)


def proportion_interval(share: float, sizes: Sequence[int]) -> Interval:
    """A share of strata of these `sizes`, and its Wilson interval, which has a width at 0 and 1 too."""
    n, note = sum(sizes), too_few(sizes)
    if note:
        return Interval(value=share if n else None, n=n, note=note)
    z = float(ndtri((1 + LEVEL) / 2))
    centre = (share + z * z / (2 * n)) / (1 + z * z / n)
    half = z * np.sqrt(share * (1 - share) / n + z * z / (4 * n * n)) / (1 + z * z / n)
    return Interval(value=share, low=max(0.0, float(centre - half)), high=min(1.0, float(centre + half)), n=n)
