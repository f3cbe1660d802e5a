"""The optimiser on costs that are known."""

import numpy as np
import pytest

from surgsim.tuning.search import minimise


def asked(cost, low, high, **given):
    """Every position that was asked for, in its batch."""
    batches = []

    def costs_of(positions):
        batches.append([np.array(x) for x in positions])
        return [cost(x) for x in positions]

    minimise(costs_of, np.array(low), np.array(high), **given)
    return batches


def valley(x):
    return float(np.sum((np.arange(1, x.size + 1) * (x - 0.4)) ** 2))


@pytest.mark.parametrize("n", [1, 2, 5])
def test_it_comes_near_the_least_cost(n):
    batches = asked(valley, [-1.0] * n, [1.0] * n, candidates=300, seed=3)
    everything = [x for batch in batches for x in batch]
    assert [x.shape for x in batches[0]] == [(n,)]
    assert batches[0][0].tolist() == [0.0] * n
    assert len(everything) == 300
    best = min(everything, key=valley)
    assert valley(best) < 1e-3 * valley(np.zeros(n))


def test_nothing_outside_the_bounds_is_asked_for():
    batches = asked(valley, [-0.1, -1.0, -1.0], [0.05, 0.0, 1.0], candidates=60, seed=0)
    everything = np.array([x for batch in batches for x in batch])
    assert (everything >= [-0.1, -1.0, -1.0]).all()
    assert (everything <= [0.05, 0.0, 1.0]).all()
    assert everything[:, 0].max() > 0.0


def test_the_seed_decides_and_a_longer_search_begins_as_a_shorter_one():
    def flat(*, candidates, seed):
        batches = asked(valley, [-1.0] * 3, [1.0] * 3, candidates=candidates, seed=seed)
        return [x.tolist() for batch in batches for x in batch]

    assert flat(candidates=30, seed=7) == flat(candidates=50, seed=7)[:30]
    assert flat(candidates=30, seed=7) != flat(candidates=30, seed=8)


def test_failures_of_great_cost_do_not_upset_it():
    def cliff(x):
        return 1100.0 if x[0] > 0.5 else valley(x)

    batches = asked(cliff, [-1.0] * 2, [1.0] * 2, candidates=150, seed=1)
    assert min(cliff(x) for batch in batches for x in batch) < 1e-3
