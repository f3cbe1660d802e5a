"""What a random sample says: a share and a median with 95 % intervals; and ranks that go together."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy import stats

from surgsim.compare.intervals import FEWEST, LEVEL, proportion_interval
from surgsim.studies.study import Judged, in_all
from surgsim.studies.tables import Row, format_cell, groups, number, numbers, span


def sample_row(values: Sequence[float]) -> Row:
    """How often it is positive, and how large: share with Wilson's interval, quartiles and median.

    The median's interval is that of order statistics, without an assumption about the distribution: the
    number of values below the median is binomial.
    """
    found = np.sort(np.asarray(values, dtype=np.float64))
    n, positive = len(found), int((found > 0.0).sum())
    share = proportion_interval(positive / n, [n])
    rank = int(stats.binom.ppf((1.0 - LEVEL) / 2.0, n, 0.5))
    low, high = (found[rank - 1], found[n - rank]) if rank else (None, None)
    quarter, median, three = np.quantile(found, (0.25, 0.5, 0.75))
    return {
        "n": n,
        "increases": positive,
        "share_percent": 100.0 * positive / n,
        "share_low_percent": _percent(share.low),
        "share_high_percent": _percent(share.high),
        "least_percent": float(found[0]),
        "quartile_1_percent": float(quarter),
        "median_percent": float(median),
        "median_low_percent": None if low is None else float(low),
        "median_high_percent": None if high is None else float(high),
        "quartile_3_percent": float(three),
        "most_percent": float(found[-1]),
    }


def _percent(share: float | None) -> float | None:
    return None if share is None else 100.0 * share


def _between(row: Row, low: str, high: str) -> str:
    ends = numbers([row], low) + numbers([row], high)
    return f" (95 %: {ends[0]:.3g} to {ends[1]:.3g} %)" if len(ends) == 2 else ""


def rank_correlation(a: Sequence[float], b: Sequence[float]) -> float:
    """Spearman's: 1 if the larger one of `a` is always the larger one of `b`, -1 if the smaller one."""
    return float(stats.spearmanr(a, b).statistic)


def judge_sample(rows: Sequence[Row], name: str, share_percent: float) -> Judged:
    """Whether each sample is positive in at least this share; `name` is the column that names them."""
    parts = []
    for row in rows:
        share, median = (
            _between(row, f"{kind}_low_percent", f"{kind}_high_percent") for kind in ("share", "median")
        )
        many = f"{row['increases']} of {row['n']}{share}"
        parts.append(f"{row[name]} {many}, median {number(row, 'median_percent'):.2f} %{median}")
    return in_all([number(row, "share_percent") >= share_percent for row in rows]), "; ".join(parts)


def judge_together(pairs: Mapping[str, tuple[Sequence[float], Sequence[float]]]) -> Judged | None:
    """Whether two figures grow together in each of the samples: Spearman's rank correlation above 0.

    None with samples of fewer than `FEWEST`.
    """
    if min(len(one) for pair in pairs.values() for one in pair) < FEWEST:
        return None
    ranks = {words: rank_correlation(*pair) for words, pair in pairs.items()}
    found = ", ".join(f"{words} {rank:+.2f}" for words, rank in ranks.items())
    return in_all([rank > 0.0 for rank in ranks.values()]), f"rank correlation: {found}"


def judge_cells(figures: Mapping[str, Sequence[float]], good: Callable[[float], bool], unit: str) -> Judged:
    """In how many cells each of several figures is good; the verdict is that of the first ones."""
    flags = {words: [good(x) for x in values] for words, values in figures.items()}
    parts = (f"{k}: {sum(f)} of {len(f)} cells, {span(figures[k])} {unit}" for k, f in flags.items())
    return in_all(next(iter(flags.values()))), "; ".join(parts)


def by(rows: Sequence[Row], group: str, column: str) -> dict[str, list[float]]:
    """The numbers of a column by what is in another one."""
    return {format_cell(key[0], 1): numbers(found, column) for key, found in groups(rows, group).items()}


def judge_ratios(samples: Mapping[str, Sequence[float]], least: float, unit: str) -> Judged | None:
    """Whether the largest figure of each sample is at least `least` times its smallest one.

    None without two figures in each.
    """
    if not samples or min(map(len, samples.values())) < 2:
        return None
    parts = (f"{span(values)} {unit} {words}" for words, values in samples.items())
    return in_all([max(values) >= least * min(values) for values in samples.values()]), "; ".join(parts)
