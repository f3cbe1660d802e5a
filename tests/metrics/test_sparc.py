"""Spectral arc length, against its published behaviour (Balasubramanian et al. 2015)."""

import math

import numpy as np
import pytest

from surgsim.metrics.catalog import METRICS
from surgsim.metrics.smoothness import sparc

RATE = 1000.0


def _bell(duration_s=1.0, rate=RATE):
    """Speed of a minimum-jerk movement over a unit distance."""
    x = np.arange(0.0, duration_s, 1.0 / rate) / duration_s
    return 30.0 * x**2 * (1.0 - x) ** 2 / duration_s


def test_a_minimum_jerk_movement_has_its_published_value():
    assert sparc(_bell(), RATE) == pytest.approx(-1.41, abs=0.01)


def test_it_is_the_arc_length_written_out():
    speed = _bell()
    size = 2 ** (math.ceil(math.log2(len(speed))) + 4)
    spectrum = np.abs(
        [np.sum(speed * np.exp(-2j * np.pi * k * np.arange(len(speed)) / size)) for k in range(170)]
    )
    spectrum = spectrum / spectrum[0]
    last = max(k for k in range(170) if spectrum[k] >= 0.05 and k * RATE / size <= 10.0)
    length = sum(math.hypot(1.0 / last, spectrum[k + 1] - spectrum[k]) for k in range(last))
    assert sparc(speed, RATE) == pytest.approx(-length, rel=1e-9)


def test_jerkier_is_lower_and_more_submovements_lower_still():
    smooth = sparc(_bell(), RATE)
    shaken = sparc(_bell() * (1.0 + 0.5 * np.sin(2 * np.pi * 6 * np.arange(1000) / RATE)), RATE)
    trains = [sparc(np.tile(_bell(), count), RATE) for count in (2, 3, 4)]
    assert shaken < smooth - 0.1
    assert smooth > trains[0] > trains[1] > trains[2]


def test_it_does_not_depend_on_size_or_sample_rate_and_little_on_duration():
    smooth = sparc(_bell(), RATE)
    assert sparc(1e-3 * _bell(), RATE) == pytest.approx(smooth, rel=1e-12)
    assert sparc(_bell(rate=500.0), 500.0) == pytest.approx(smooth, abs=0.01)
    assert sparc(_bell(duration_s=2.0), RATE) == pytest.approx(smooth, abs=0.02)


@pytest.mark.parametrize("speed", [np.zeros(100), np.ones(3), np.array([0, 1, np.nan, 1, 0, 0.0])])
def test_it_is_not_defined_for_what_does_not_move(speed):
    assert math.isnan(sparc(speed, RATE))


def test_the_metric_is_that_of_the_tip_s_speed(trace_of):
    distance = np.concatenate([[0.0], np.cumsum(_bell()) / RATE])
    tip = np.outer(distance, [0.06, 0.0, -0.08])
    value = METRICS["sparc"].compute(trace_of(1001, tip=tip))
    assert value == pytest.approx(sparc(_bell(), RATE), rel=1e-9)
