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
