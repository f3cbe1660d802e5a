"""Numbers of a scorecard, with intervals; a failed run is never averaged away.

A quantile is taken over all runs; one that did not come to its end counts as worse than any value. Its
interval is between order statistics, with ranks from the binomial distribution (Conover, Practical
Nonparametric Statistics, 3rd edition, section 3.2): it covers at least 95 % whatever the distribution, and is
open above where there are too few runs to close it. Runs of unlike scenarios keep it on the safe side
(Hoeffding, Annals of Mathematical Statistics 27, 1956). Shares have the Wilson interval.
"""

import math
from collections.abc import Sequence

import numpy as np
from scipy import stats

from surgsim.compare.intervals import LEVEL, NOTHING, Interval, proportion_interval
from surgsim.protocol.cells import BASE
from surgsim.protocol.definition import FigureConfig, ProtocolConfig
from surgsim.protocol.levels import AxisResult
from surgsim.protocol.rows import Row


def figures_of(
    rows: Sequence[Row], axes: Sequence[AxisResult], protocol: ProtocolConfig
) -> dict[str, Interval]:
    """The protocol's figures by name, of runs with no axis changed; those about axes of all."""
    base = [row for row in rows if row.counts and row.axis == BASE]
    return {name: _figure(figure, base, axes) for name, figure in protocol.figures.items()}


def _figure(figure: FigureConfig, rows: Sequence[Row], axes: Sequence[AxisResult]) -> Interval:
    if figure.kind == "completed":
        return share([row.completed for row in rows])
    if figure.kind == "done":
        return share([not row.failed for row in rows])
    if figure.kind == "held":
        return _held(axes)
    assert figure.metric is not None
    return _quantile_of(rows, figure.metric, figure.quantile)


def share(hits: Sequence[bool]) -> Interval:
    """Share of runs, with its Wilson interval."""
    value = sum(hits) / len(hits) if hits else 0.0
    return proportion_interval(value, [len(hits)])


def _held(axes: Sequence[AxisResult]) -> Interval:
    """Share of all levels below the first failing one; the levels are chosen, not drawn: no interval."""
    total = sum(len(axis.levels) - 1 for axis in axes)
    held = sum(axis.held for axis in axes)
    if not total:
        return Interval(value=None, note=NOTHING)
    return Interval(value=held / total, n=total, note=f"{held} of {total} levels: chosen, so no interval")


def _quantile_of(rows: Sequence[Row], metric: str, p: float) -> Interval:
    """Quantile over runs that define the metric, or failed."""
    values = [_value(row, metric) for row in rows]
    known = np.array([value for value in values if value is not None])
    if not np.isfinite(known).any():
        return Interval(value=None, n=0, note=NOTHING)
    return quantile_interval(known, p)


def _value(row: Row, metric: str) -> float | None:
    return row.metrics[metric] if row.completed else math.inf


def quantile_interval(values: np.ndarray, p: float) -> Interval:
    """The p-quantile of values (n,), infinite for failures, and its interval; None where not finite.

    Example:
        >>> quantile_interval(np.arange(1.0, 101.0), 0.95).value
        95.0
    """
    n, ordered = len(values), np.sort(values)
    value = float(ordered[max(math.ceil(p * n - 1e-9), 1) - 1])
    below = int(stats.binom.ppf((1.0 - LEVEL) / 2.0, n, p))
    above = int(stats.binom.ppf((1.0 + LEVEL) / 2.0, n, p)) + 1
    low = float(ordered[below - 1]) if below >= 1 else None
    high = float(ordered[above - 1]) if above <= n else None
    failed = int(np.isinf(values).sum())
    note = f"{failed} of {n} runs failed" if failed else ""
    if high is None:
        note = ", ".join(filter(None, (note, f"open above: {n} runs")))
    return Interval(value=_finite(value), low=_finite(low), high=_finite(high), n=n, note=note)


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
