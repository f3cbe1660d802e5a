"""Torque bias: what acts and what is measured of a command, for a sensor, a drive and a torque loop."""

import numpy as np
import pytest

from surgsim.plant.disturbances.torque_bias import TorqueBiasConfig

CASES = {"sensor": (0.0, 1.0), "drive": (1.0, 1.0), "loop": (-1.0, 0.0)}  # acting, measured, in biases


@pytest.mark.parametrize("of", CASES)
def test_what_acts_and_what_is_measured_is_off_by_the_bias_or_not(disturbed, of):
    biased = disturbed.plant_of(TorqueBiasConfig(bias_nm=0.5, of=of))
    acting, measured = CASES[of]
    exact = disturbed.plant_of()
    biased.reset(np.full(7, 0.3)), exact.reset(np.full(7, 0.3))
    for k in range(20):
        command = np.linspace(-3.0, 3.0, 7) + 0.1 * k
        seen, wanted = biased.step(command, np.zeros(7)), exact.step(command + 0.5 * acting, np.zeros(7))
        np.testing.assert_array_equal(seen.q, wanted.q)
        np.testing.assert_allclose(seen.tau, command + 0.5 * measured, atol=1e-14)


def test_signs_and_sizes_are_drawn_for_each_joint_from_the_seed(disturbed):
    def bias(seed):
        config = TorqueBiasConfig(bias_nm=0.4, of="sensor", signs="random", spread=0.5)
        scene, (part,) = disturbed.scene_of(config, seed=seed)
        part.attach(scene, 0.001)
        return part.gains[7:]

    drawn = np.array([bias(seed) for seed in range(30)])
    assert np.abs(drawn).min() >= 0.2
    assert np.abs(drawn).max() <= 0.6
    assert np.unique(drawn).size == drawn.size
    assert 0.3 < (drawn > 0).mean() < 0.7
    np.testing.assert_array_equal(bias(3), drawn[3])
