"""Breathing: a smooth motion of the port, and what of it the controller is told."""

import numpy as np
import pytest

from surgsim.errors import ScenarioError, SurgsimError
from surgsim.plant.disturbances.breathing import BreathingConfig
from surgsim.plant.disturbances.trocar_calibration import TrocarCalibrationConfig
from surgsim.simulate.setup import prepare
from surgsim.spatial import shaft_distance

T = np.arange(0.0, 12.0, 1e-3)
ZERO = np.zeros(7)
seens = pytest.mark.parametrize("seen", ["announced", "tracked", "hidden"])


@pytest.fixture
def built(disturbed):
    """A breath of these keys."""
    return lambda seed=0, **keys: disturbed.started(BreathingConfig(**keys), seed)


def _motion(breathing, t=T):
    motions = [breathing.port_motion(x) for x in t]
    return tuple(np.array(rows) for rows in zip(*motions, strict=True))


@pytest.mark.parametrize("seed", range(4))
def test_velocity_is_the_offset_s_exact_derivative_and_acceleration_has_no_step(built, seed):
    breathing = built(seed, random_phase=True, rate_hz=0.35, ramp_s=1.3, amplitude_m=0.02)
    h = 1e-5
    ahead, behind = (_motion(breathing, T + sign * h)[0] for sign in (1, -1))
    velocity = _motion(breathing)[1]
    np.testing.assert_allclose(velocity[1:], ((ahead - behind) / (2 * h))[1:], atol=1e-8)
    acceleration = np.diff(velocity, axis=0) / 1e-3
    assert np.abs(np.diff(acceleration, axis=0)).max() < 0.02 * np.abs(acceleration).max()


def test_it_goes_from_the_configured_place_by_the_amplitude_and_back_with_1_to_1_5(built):
    offset, _ = _motion(built(direction=(0.0, 0.0, 2.0)))
    z = offset[:, 2]
    np.testing.assert_array_equal(offset[:, :2], 0.0)
    assert z.min() == 0.0
    assert z.max() == pytest.approx(0.005)
    assert T[np.argmax(z[:5000])] == pytest.approx(2.0, abs=1e-3)  # 1 of 2.5 parts of five seconds
    np.testing.assert_allclose(z[5000:10000:5000], 0.0, atol=1e-9)
    np.testing.assert_allclose(z[6000:11000], np.roll(z[1000:6000], 0), atol=1e-12)  # every five seconds


@pytest.mark.parametrize("seed", range(5))
def test_it_begins_at_rest_at_the_configured_place_at_any_point_of_the_breath(built, seed):
    offset, velocity = _motion(built(seed, random_phase=True))
    np.testing.assert_array_equal(offset[0], 0.0)
    np.testing.assert_array_equal(velocity[0], 0.0)
    assert np.abs(velocity[1]).max() < 1e-6


def test_phase_and_excursion_are_drawn_from_the_seed(built):
    def at(seed):
        return _motion(built(seed, random_phase=True, spread=0.2), [2.5, 4.0])[0]

    assert len({at(seed).tobytes() for seed in range(5)}) == 5
    np.testing.assert_array_equal(at(3), at(3))
    peaks = [np.linalg.norm(_motion(built(seed, spread=0.2))[0], axis=1).max() for seed in range(20)]
    assert min(peaks) >= 0.004 - 1e-9
    assert max(peaks) <= 0.006 + 1e-9
    assert np.ptp(peaks) > 0.0005


@seens
def test_the_port_moves_and_the_controller_is_told_what_is_said(disturbed, seen):
    config = BreathingConfig(seen=seen, rate_hz=5.0, ramp_s=0.01)
    plant = disturbed.plant_of(config, trocar=True)
    breathing = disturbed.started(config)
    state = plant.reset(np.full(7, 0.3))
    for k in range(1, 101):
        state = plant.step(ZERO, ZERO)
        offset, velocity = breathing.port_motion(k * disturbed.DT)
        true = disturbed.HOME + offset
        np.testing.assert_allclose(plant.truth().p_WC, true, atol=1e-15)
        known = disturbed.HOME if seen == "hidden" else true
        np.testing.assert_allclose(state.p_WC, known, atol=1e-15)
        told = velocity if seen == "announced" else np.zeros(3)
        np.testing.assert_allclose(state.v_WC, told, atol=1e-15)
    assert np.abs(true - disturbed.HOME).max() > 0.003


@pytest.mark.parametrize("order", [(0, 1, 2, 3), (3, 2, 1, 0), (2, 0, 3, 1)])
def test_breaths_and_a_calibration_error_add_up_in_any_order(disturbed, order):
    error = np.array([0.001, -0.002, 0.0005])
    breaths = [
        BreathingConfig(seen="announced", rate_hz=3.0, ramp_s=0.01, direction=(1.0, 0.0, 0.0)),
        BreathingConfig(seen="tracked", rate_hz=4.0, ramp_s=0.01, direction=(0.0, 1.0, 0.0)),
        BreathingConfig(seen="hidden", rate_hz=5.0, ramp_s=0.01, direction=(0.0, 1.0, 1.0)),
    ]
    configs = [*breaths, TrocarCalibrationConfig(error_m=tuple(error))]
    plant = disturbed.plant_of(*[configs[i] for i in order], trocar=True)
    plant.reset(np.full(7, 0.3))
    for _ in range(80):
        state = plant.step(ZERO, ZERO)
    said, tracked, hidden = (disturbed.started(config).port_motion(0.08) for config in breaths)
    seen = disturbed.HOME + said[0] + tracked[0]
    np.testing.assert_allclose(plant.truth().p_WC, seen + hidden[0], atol=1e-15)
    np.testing.assert_allclose(state.p_WC, seen + error, atol=1e-15)
    np.testing.assert_allclose(state.v_WC, said[1], atol=1e-15)
    assert min(np.abs(offset).max() for offset, _ in (said, tracked, hidden)) > 1e-4


def test_along_the_shaft_it_does_not_disturb_the_remote_centre_and_across_it_does(built):
    tip, wrist = np.array([0.0, 0.0, -0.2]), np.array([0.0, 0.0, 0.2])
    along, across = (
        _motion(built(direction=direction), [2.0])[0][0] for direction in ((0, 0, 1.0), (1.0, 0, 0))
    )
    assert shaft_distance(along, tip, wrist) == pytest.approx(0.0, abs=1e-15)
    assert shaft_distance(across, tip, wrist) == pytest.approx(0.005)


@pytest.mark.parametrize("name", ["breathing", "trocar_calibration"])
def test_without_a_trocar_it_is_refused(scenario, name):
    free = scenario(
        "trocar=null", "start.q_rad=[1.6, -0.5, 0.0, 1.5, 0.0, -1.0, 0.0]", "task.start_m=null",
        f"disturbances=[{{type: {name}}}]", controller="joint_impedance",
    )  # fmt: skip
    with pytest.raises(SurgsimError, match=f"disturbance '{name}' needs a trocar, and the scenario has none"):
        prepare(free)


def test_a_zero_direction_is_refused(scenario):
    with pytest.raises(ScenarioError, match="direction must not be zero"):
        scenario("disturbances=[{type: breathing, direction: [0.0, 0.0, 0.0]}]")
