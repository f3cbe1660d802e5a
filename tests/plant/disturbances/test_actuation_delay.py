"""Actuation delay: every torque acts exactly so many periods later."""

import numpy as np
import pytest

from surgsim.errors import ScenarioError
from surgsim.plant.disturbances.actuation_delay import ActuationDelayConfig


def _acting(disturbed, delay_s, commands, plant=None):
    plant = plant or disturbed.plant_of(ActuationDelayConfig(delay_s=delay_s))
    plant.reset(np.full(7, 0.3))
    return np.array([plant.step(command, np.zeros(7)).tau for command in commands])


@pytest.mark.parametrize("ticks", [1, 2, 5, 17])
def test_torques_act_so_many_ticks_later_and_the_first_one_fills(disturbed, ticks):
    commands = np.random.default_rng(ticks).uniform(-20.0, 20.0, (40, 7))
    acting = _acting(disturbed, ticks * disturbed.DT, commands)
    np.testing.assert_array_equal(acting[ticks:], commands[:-ticks])
    np.testing.assert_array_equal(acting[:ticks], np.tile(commands[0], (ticks, 1)))


def test_saturation_comes_before_the_delay(arm, disturbed):
    commands = np.full((10, 7), 1e4)
    np.testing.assert_array_equal(_acting(disturbed, 0.003, commands), np.tile(arm.limits.torque, (10, 1)))


def test_a_reset_empties_the_queue(disturbed):
    plant = disturbed.plant_of(ActuationDelayConfig(delay_s=0.005))
    rng = np.random.default_rng(0)
    first, second = rng.uniform(-5.0, 5.0, (2, 12, 7))
    _acting(disturbed, 0.005, first, plant)
    np.testing.assert_array_equal(_acting(disturbed, 0.005, second, plant), _acting(disturbed, 0.005, second))


@pytest.mark.parametrize("delay_s", [0.0015, 0.0004, 0.0101])
def test_a_delay_that_is_no_multiple_of_the_period_is_refused_with_the_scenario(scenario, delay_s):
    message = f"delay_s {delay_s:g} must be a whole multiple of control_period_s 0.001"
    with pytest.raises(ScenarioError, match=message):
        scenario(f"disturbances=[{{type: actuation_delay, delay_s: {delay_s}}}]")


def test_a_motion_is_late_by_the_delay_and_otherwise_the_same(disturbed):
    """Held by the first command, then the same torques a little later."""
    hold, commands = np.zeros((1, 7)), np.random.default_rng(0).uniform(-5.0, 5.0, (20, 7))
    late = disturbed.plant_of(ActuationDelayConfig(delay_s=0.004))
    prompt = disturbed.plant_of()

    def motion(plant, torques):
        plant.reset(np.full(7, 0.3))
        return np.array([plant.step(torque, np.zeros(7)).q for torque in torques])

    delayed = motion(late, [*hold, *commands])
    shifted = motion(prompt, [*np.tile(hold, (5, 1)), *commands])[: len(delayed)]
    np.testing.assert_array_equal(delayed, shifted)


def _arrivals(disturbed, seed, ticks=2, jitter=3, n=4000):
    """Number of the command that acts at each tick."""
    config = ActuationDelayConfig(delay_s=ticks * disturbed.DT, jitter_s=jitter * disturbed.DT)
    delay = disturbed.started(config, seed)
    return delay.actuate(np.tile(np.arange(float(n))[:, None], 7))[:, 0].astype(int)


def test_with_jitter_every_command_is_late_by_its_own_time_and_none_overtakes(disturbed):
    acting = _arrivals(disturbed, 0)
    age = np.arange(len(acting)) - acting
    assert (np.diff(acting) >= 0).all()
    assert set(age[10:]) == {2, 3, 4, 5}
    np.testing.assert_array_equal(acting[:2], 0)
    missed = 1.0 - len(np.unique(acting)) / len(acting)  # arrived together with a newer one
    assert 0.3 < missed < 0.7


def test_jitter_is_as_likely_to_be_each_number_of_ticks(disturbed):
    """The acting command is as old as the delay when it had no jitter, and those before it not too much."""
    age = np.arange(20000) - _arrivals(disturbed, 1, n=20000)
    assert (age[10:] == 2).mean() == pytest.approx(1 / 4 * 2 / 4 * 3 / 4, rel=0.1)


def test_jitter_repeats_from_the_seed(disturbed):
    np.testing.assert_array_equal(_arrivals(disturbed, 3), _arrivals(disturbed, 3))
    assert (_arrivals(disturbed, 3) != _arrivals(disturbed, 4)).any()


def test_a_jitter_that_is_no_multiple_of_the_period_is_refused(scenario):
    with pytest.raises(ScenarioError, match=r"jitter_s 0\.0005 must be a whole multiple"):
        scenario("disturbances=[{type: actuation_delay, jitter_s: 0.0005}]")
