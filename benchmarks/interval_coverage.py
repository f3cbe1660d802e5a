"""Measures how often the 95 % intervals of pages and scorecards cover the truth, by simulation.

`python benchmarks/interval_coverage.py` writes `interval_coverage.json` beside it, in three minutes;
`docs/statistics.md` shows it as a table, and a test makes a part of it again. Every trial has its own
random numbers, by its place in the table, so a part is the same as in the whole.

"""

import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from surgsim.compare.aggregates import interquartile_mean
from surgsim.compare.intervals import (
    FEWEST,
    Interval,
    mean_interval,
    percentile,
    proportion_interval,
    resampled,
)
from surgsim.protocol.figures import quantile_interval

Array = NDArray[np.float64]
Drawn = Callable[[np.random.Generator, int], Array]

KEPT = Path(__file__).with_name("interval_coverage.json")
TRIALS = 1000
SIZES = (5, 10, 20, 80)
SHARE = 0.95
PROPORTIONS = (0.8, 0.95, 0.99)
DEGREES = 3
"""Degrees of freedom of the heavy-tailed law: it has a variance, but no third moment."""

LAWS: dict[str, Any] = {
    "normal": stats.norm(),
    "lognormal": stats.lognorm(1.0),
    "heavy tails": stats.t(DEGREES),
}


def _mean(law: Any, n: int, rng: np.random.Generator) -> tuple[Interval, float]:
    return mean_interval([law.rvs(n, random_state=rng)]), float(law.mean())


def _paired(law: Any, n: int, rng: np.random.Generator) -> tuple[Interval, float]:
    """Two controllers with the same seeds: the seed's part is common to both, the rest is their own."""
    seed, a, b = (law.rvs(n, random_state=rng) for _ in range(3))
    return mean_interval([(seed + 1.5 * a) - (seed + b)]), 0.5 * float(law.mean())


def _quantile(law: Any, n: int, rng: np.random.Generator) -> tuple[Interval, float]:
    return quantile_interval(law.rvs(n, random_state=rng), SHARE), float(law.ppf(SHARE))


def _quantile_by_bootstrap(law: Any, n: int, rng: np.random.Generator) -> tuple[Interval, float]:
    """What is usual, and not used here."""
    values = law.rvs(n, random_state=rng)
    drawn = values[rng.integers(0, n, (2000, n))]
    low, high = np.quantile(np.quantile(drawn, SHARE, axis=1), [0.025, 0.975])
    return Interval(value=None, low=float(low), high=float(high), n=n), float(law.ppf(SHARE))


def _middle(law: Any, n: int, rng: np.random.Generator) -> tuple[Interval, float]:
    """Interquartile mean with the expanded percentile interval."""
    runs = law.rvs(n, random_state=rng)[:, None]
    low, high = percentile(resampled([runs], interquartile_mean, "coverage"), [n])
    return Interval(value=None, low=low, high=high, n=n), _middle_of(law)


def _middle_of(law: Any) -> float:
    """Mean of the middle half of a law."""
    shares = (np.arange(20000) + 0.5) / 40000 + 0.25
    return float(np.mean(law.ppf(shares)))


METHODS: dict[str, Callable[[Any, int, np.random.Generator], tuple[Interval, float]]] = {
    "mean": _mean,
    "paired difference": _paired,
    "interquartile mean": _middle,
    "95 % quantile": _quantile,
    "95 % quantile, bootstrap (not used)": _quantile_by_bootstrap,
}


def covered(method: str, law: str, n: int, trials: Sequence[int]) -> list[bool]:
    """Whether the interval of each of these trials covers the truth; an open end covers all beyond it."""
    place = (list(METHODS).index(method), list(LAWS).index(law), n)
    found = []
    for trial in trials:
        rng = np.random.default_rng([*place, trial])
        interval, truth = METHODS[method](LAWS[law], n, rng)
        low = -np.inf if interval.low is None else interval.low
        high = np.inf if interval.high is None else interval.high
        found.append(bool(low <= truth <= high))
    return found


def coverage_of_proportion(share: float, n: int) -> float:
    """Coverage of the Wilson interval of a completion rate, exactly: a sum over all counts."""
    counts = np.arange(n + 1)
    intervals = [proportion_interval(count / n, [n]) for count in counts]
    inside = [i.low is not None and i.high is not None and i.low <= share <= i.high for i in intervals]
    return float(stats.binom.pmf(counts, n, share)[inside].sum())


def measure(trials: int = TRIALS) -> dict[str, Any]:
    """The whole table: covered trials of each method, law and number of seeds."""
    hits: dict[str, dict[str, dict[str, int]]] = {}
    for method in METHODS:
        for law in LAWS:
            for n in SIZES:
                count = sum(covered(method, law, n, range(trials)))
                hits.setdefault(method, {}).setdefault(law, {})[str(n)] = count
                print(f"{method}, {law}, n = {n}: {count / trials:.3f}", file=sys.stderr)
    proportions = {
        f"{share:g}": {str(n): round(coverage_of_proportion(share, n), 4) for n in SIZES}
        for share in PROPORTIONS
    }
    return {"trials": trials, "fewest": FEWEST, "covered": hits, "completion rate": proportions}


def main() -> int:
    """Write the table."""
    KEPT.write_text(json.dumps(measure(), indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
