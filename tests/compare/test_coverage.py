"""How often intervals cover the truth: a part of what the documents say made again, and quantiles by hand."""

import importlib
import json
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from surgsim.protocol.figures import quantile_interval

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
TRIALS = 60


@pytest.fixture(scope="module")
def study():
    """The script that measures it."""
    sys.path.insert(0, str(BENCHMARKS))
    try:
        yield importlib.import_module("interval_coverage")
    finally:
        sys.path.pop(0)


@pytest.fixture(scope="module")
def kept():
    return json.loads((BENCHMARKS / "interval_coverage.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize("law", ["normal", "lognormal", "heavy tails"])
@pytest.mark.parametrize(
    "method",
    [
        "mean",
        "paired difference",
        "interquartile mean",
        "95 % quantile",
        "95 % quantile, bootstrap (not used)",
    ],
)
def test_the_kept_coverage_is_that_of_the_code(study, kept, method, law):
    """A part of the trials again: as many covered as a part of the kept ones, by chance, would be."""
    assert kept["covered"].keys() == study.METHODS.keys()
    covered = sum(study.covered(method, law, 10, range(TRIALS)))
    share = kept["covered"][method][law]["10"] / kept["trials"]
    low, high = stats.hypergeom.ppf([1e-4, 1 - 1e-4], kept["trials"], round(share * kept["trials"]), TRIALS)
    assert low <= covered <= high


def test_the_coverage_of_rates_is_that_of_the_code(study, kept):
    for share, by_size in kept["completion rate"].items():
        for n, told in by_size.items():
            assert study.coverage_of_proportion(float(share), int(n)) == pytest.approx(told, abs=1e-4)


def test_no_interval_that_is_used_covers_less_than_the_documents_say(kept):
    for method, laws in kept["covered"].items():
        least = min(count for by_size in laws.values() for count in by_size.values()) / kept["trials"]
        if "not used" in method:
            assert least < 0.5
        else:
            assert least >= (0.95 if "quantile" in method else 0.88)


def test_a_quantile_lies_between_two_runs_by_the_binomial_law():
    values = np.random.default_rng(3).permutation(np.arange(1.0, 101.0))
    found = quantile_interval(values, 0.95)
    inside = stats.binom.cdf(found.high - 1, 100, 0.95) - stats.binom.cdf(found.low - 1, 100, 0.95)
    tighter = [
        stats.binom.cdf(found.high - 1, 100, 0.95) - stats.binom.cdf(found.low, 100, 0.95),
        stats.binom.cdf(found.high - 2, 100, 0.95) - stats.binom.cdf(found.low - 1, 100, 0.95),
    ]
    assert (found.value, found.low, found.high, found.note) == (95.0, 90.0, 100.0, "")
    assert inside >= 0.95
    assert 1 - stats.binom.cdf(found.high - 2, 100, 0.95) > 0.025  # an end nearer would cut off too much
    assert stats.binom.cdf(found.low, 100, 0.95) > 0.025
    assert max(tighter) < inside


def test_a_high_quantile_of_few_runs_is_open_above_and_says_so():
    few, enough = (quantile_interval(np.arange(float(n)), 0.95) for n in (71, 72))
    assert (few.low, few.high, few.note) == (62.0, None, "open above: 71 runs")
    assert (enough.high, enough.note) == (71.0, "")
