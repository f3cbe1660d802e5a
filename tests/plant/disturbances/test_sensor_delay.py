"""Sensor delay: every measurement is exactly so many periods old, the time is the present."""

import numpy as np
import pytest

from surgsim.errors import ScenarioError
from surgsim.plant.disturbances.breathing import BreathingConfig
from surgsim.plant.disturbances.sensor_delay import SensorDelayConfig

NAMES = ("q", "v", "tau", "p_WC", "v_WC", "f_T")


@pytest.mark.parametrize("ticks", [1, 2, 7])
def test_the_whole_state_is_so_old_and_the_first_one_fills(disturbed, ticks):
    delay = disturbed.started(SensorDelayConfig(delay_s=ticks * disturbed.DT))
    states = [disturbed.state_at(k) for k in range(30)]
    measured = delay.sense(states)
    assert [state.t_s for state in measured] == [state.t_s for state in states]
    for k, state in enumerate(measured):
        for name in NAMES:
            np.testing.assert_array_equal(getattr(state, name), getattr(states[max(k - ticks, 0)], name))


def test_a_reset_empties_the_queue(disturbed):
    delay = disturbed.started(SensorDelayConfig())
    delay.sense([disturbed.state_at(k) for k in range(5)])
    delay.start(0)
    late = disturbed.state_at(9)
    np.testing.assert_array_equal(delay.sense([late])[0].q, late.q)


@pytest.mark.parametrize("swapped", [False, True])
def test_what_is_told_of_a_breath_is_as_old_wherever_it_stands_in_the_list(disturbed, swapped):
    breathing = BreathingConfig(seen="announced", rate_hz=5.0, ramp_s=0.01)
    configs = [breathing, SensorDelayConfig(delay_s=0.005)]
    plant = disturbed.plant_of(*(configs[::-1] if swapped else configs), trocar=True)
    plant.reset(np.full(7, 0.3))
    for _ in range(40):
        state = plant.step(np.zeros(7), np.zeros(7))
    offset, velocity = disturbed.started(breathing).port_motion(0.035)
    np.testing.assert_allclose(state.p_WC, disturbed.HOME + offset, atol=1e-15)
    np.testing.assert_allclose(state.v_WC, velocity, atol=1e-15)


def test_a_delay_that_is_no_multiple_of_the_period_is_refused_with_the_scenario(scenario):
    message = "sensor_delay: delay_s 0.0015 must be a whole multiple of control_period_s 0.001"
    with pytest.raises(ScenarioError, match=message):
        scenario("disturbances=[{type: sensor_delay, delay_s: 0.0015}]")
