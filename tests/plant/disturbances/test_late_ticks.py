"""Late ticks: the last torque holds for bursts of ticks, as often as stated."""

import numpy as np
import pytest

from surgsim.plant.disturbances.late_ticks import LateTicksConfig

N = 20000


def _acting(disturbed, seed=0, **keys):
    """Number of the command that acts at each tick."""
    late = disturbed.started(LateTicksConfig(**keys), seed)
    return late.actuate(np.tile(np.arange(float(N))[:, None], 7))[:, 0].astype(int)


@pytest.mark.parametrize(("probability", "burst"), [(0.05, 1), (0.02, 4), (0.5, 2)])
def test_as_many_ticks_are_lost_as_expected_and_the_last_torque_holds(disturbed, probability, burst):
    acting = _acting(disturbed, probability=probability, burst_ticks=burst)
    fresh = acting == np.arange(N)
    held = np.maximum.accumulate(np.where(fresh, np.arange(N), 0))
    np.testing.assert_array_equal(acting, held)
    assert fresh[0]
    mean = (1 + burst) / 2
    lost = probability * mean / (1.0 - probability + probability * mean)
    assert (~fresh).mean() == pytest.approx(lost, rel=0.1)


def test_bursts_have_every_length_to_the_longest(disturbed):
    acting = _acting(disturbed, probability=0.01, burst_ticks=5)
    lengths = np.bincount(np.diff(np.flatnonzero(acting == np.arange(N))) - 1)
    assert lengths[1:6].min() > 0.6 * lengths[1:].sum() / 5
    assert lengths[6:].sum() < 0.05 * lengths[1:].sum()  # one after another


def test_it_repeats_from_the_seed(disturbed):
    np.testing.assert_array_equal(_acting(disturbed, 1), _acting(disturbed, 1))
    assert (_acting(disturbed, 1) != _acting(disturbed, 2)).any()
