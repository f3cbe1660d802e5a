"""Torque quantisation: the nearest whole step acts and is measured, after the delay and before the bias."""

import numpy as np
import pytest

from surgsim.plant.disturbances.torque_bias import TorqueBiasConfig
from surgsim.plant.disturbances.torque_quantisation import TorqueQuantisationConfig


@pytest.mark.parametrize("step", [0.05, 0.3])
def test_the_nearest_whole_step_acts(disturbed, step):
    plant = disturbed.plant_of(TorqueQuantisationConfig(step_nm=step))
    plant.reset(np.full(7, 0.3))
    commands = np.random.default_rng(0).uniform(-30.0, 30.0, (100, 7))
    acting = np.array([plant.step(command, np.zeros(7)).tau for command in commands])
    np.testing.assert_allclose(acting / step, np.round(acting / step), atol=1e-9)
    error = np.abs(acting - commands)
    assert 0.45 * step < error.max() <= 0.5 * step * (1 + 1e-9)


@pytest.mark.parametrize("swapped", [False, True])
def test_a_bias_of_the_drive_is_not_rounded_away_wherever_it_stands_in_the_list(disturbed, swapped):
    configs = [TorqueQuantisationConfig(step_nm=1.0), TorqueBiasConfig(bias_nm=0.3, of="drive")]
    plant = disturbed.plant_of(*(configs[::-1] if swapped else configs))
    plant.reset(np.full(7, 0.3))
    np.testing.assert_allclose(plant.step(np.full(7, 2.2), np.zeros(7)).tau, 2.3)
