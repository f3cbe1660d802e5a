"""The depth task: its strokes, its circle, and straight in and out."""

import numpy as np
import pytest

from surgsim.tasks.depth import DepthConfig

START = np.array([0.1, -0.4, 0.2])


def _points(config):
    task = config.build(START)
    return np.array([task.command(t).p_WTd for t in np.linspace(0.0, task.duration_s, 4001)]) - START


def test_it_goes_in_and_out_by_its_depth_and_comes_back():
    p = _points(DepthConfig(normal=(0.0, 0.0, -1.0), radius_m=0.02, turns=1.0, depth_m=0.05, strokes=3.0))
    deep = -p[:, 2]
    assert deep.min() == pytest.approx(0.0, abs=1e-12)
    assert deep.max() == pytest.approx(0.05, rel=1e-5)
    assert np.sum(np.diff(np.sign(deep - 0.025)) != 0) == 6
    np.testing.assert_allclose(np.hypot(p[:, 0] + 0.02, p[:, 1]), 0.02, atol=1e-12)
    np.testing.assert_allclose(p[-1], 0.0, atol=1e-12)


def test_without_a_radius_it_goes_straight():
    p = _points(DepthConfig(radius_m=0.0))
    np.testing.assert_array_equal(p[:, :2], 0.0)
    assert np.ptp(p[:, 2]) == pytest.approx(0.06, rel=1e-5)
