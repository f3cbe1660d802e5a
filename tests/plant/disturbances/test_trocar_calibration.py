"""Trocar calibration: the controller believes the trocar beside where it is."""

import numpy as np

from surgsim.plant.disturbances.trocar_calibration import TrocarCalibrationConfig
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import prepare

ZERO = np.zeros(7)


def _error(seed, **keys):
    return TrocarCalibrationConfig(**keys).build(np.random.default_rng(seed)).gains


def test_the_known_place_is_beside_the_true_one_which_stays(disturbed):
    plant = disturbed.plant_of(TrocarCalibrationConfig(error_m=(0.001, 0.002, -0.003)), trocar=True)
    states = [plant.reset(np.full(7, 0.3)), plant.step(ZERO, ZERO), plant.step(ZERO, ZERO)]
    for state in states:
        np.testing.assert_allclose(state.p_WC - disturbed.HOME, [0.001, 0.002, -0.003], atol=1e-15)
        np.testing.assert_array_equal(state.v_WC, 0.0)
    np.testing.assert_array_equal(plant.truth().p_WC, disturbed.HOME)


def test_direction_and_size_are_drawn_from_the_seed():
    drawn = np.array([_error(s, error_m=(0.003, 0.0, 0.004), direction="random") for s in range(200)])
    np.testing.assert_allclose(np.linalg.norm(drawn, axis=1), 0.005)
    assert np.abs(drawn.mean(axis=0)).max() < 0.001
    sizes = np.linalg.norm([_error(s, direction="random", spread=0.5) for s in range(100)], axis=1)
    assert sizes.min() >= 0.0005
    assert sizes.max() <= 0.0015
    assert np.ptp(sizes) > 0.0005
    np.testing.assert_array_equal(
        _error(3, direction="random", spread=0.5), _error(3, direction="random", spread=0.5)
    )


def test_a_controller_that_holds_the_known_place_misses_the_true_one_by_the_error(scenario):
    """At rest, an RCM law settles where it believes the trocar to be."""
    keys = ("task.radius_m=0.0001", "task.duration_s=0.6", "task.ramp_s=0.1")
    error = "disturbances=[{type: trocar_calibration, error_m: [0.001, 0.0, 0.0]}]"
    simulation = Simulation(prepare(scenario(*keys, error, controller="rcm_inverse_dynamics")))
    trace = simulation.run()
    shaft = simulation.state.p_WC - np.array([0.0, 0.55, 0.2])
    assert shaft[0] == 0.001
    assert 0.0008 < trace.block("rcm_error")[-1, 0] < 0.00101
