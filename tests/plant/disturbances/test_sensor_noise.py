"""Sensor noise: white, of the stated size on each sensor; encoder steps; differences; a slow tracker."""

import numpy as np
import pytest
from scipy.signal import lfilter

from surgsim.errors import ScenarioError
from surgsim.plant.disturbances.sensor_noise import SensorNoiseConfig
from surgsim.plant.part import BLOCK_TICKS

QUIET = dict(
    position_std_rad=0.0, velocity_std_rad_per_s=0.0, torque_std_nm=0.0, port_std_m=0.0, tip_force_std_n=0.0
)
STD = {
    "position_std_rad": ("q", 2e-4),
    "velocity_std_rad_per_s": ("v", 3e-3),
    "torque_std_nm": ("tau", 0.2),
    "port_std_m": ("p_WC", 1e-4),
    "tip_force_std_n": ("f_T", 0.3),
}


def _measured(disturbed, config, states, seed=0):
    return disturbed.started(config, seed).sense(states)


def _stack(states, name):
    return np.array([getattr(state, name) for state in states])


def test_each_sensor_has_white_noise_of_its_size_and_no_other(disturbed):
    still = [disturbed.state_at(k) for k in range(3000)]
    for key, (name, std) in STD.items():
        measured = _measured(disturbed, SensorNoiseConfig(**(QUIET | {key: std})), still)
        for other in ("q", "v", "tau", "p_WC", "v_WC", "f_T"):
            error = _stack(measured, other) - _stack(still, other)
            if other != name:
                np.testing.assert_allclose(error, 0.0, atol=1e-15, err_msg=other)
                continue
            np.testing.assert_allclose(error.std(axis=0), std, rtol=0.06)
            assert np.abs(error.mean(axis=0)).max() < 0.1 * std
            correlation = np.corrcoef(np.hstack([error[1:], error[:-1]]).T)
            assert np.abs(correlation - np.eye(len(correlation))).max() < 0.1


def test_noise_repeats_from_the_seed_and_after_a_reset(disturbed):
    states = [disturbed.state_at(k) for k in range(600)]
    sensors = disturbed.started(SensorNoiseConfig(port_std_m=1e-4))
    first = sensors.sense(states)
    sensors.start([0, 1])
    again = sensors.sense(states)
    other = _measured(disturbed, SensorNoiseConfig(port_std_m=1e-4), states, seed=1)
    for name in ("q", "v", "tau", "p_WC", "f_T"):
        np.testing.assert_array_equal(_stack(first, name), _stack(again, name))
        assert (_stack(first, name) != _stack(other, name)).all()


def test_noise_is_one_sequence_of_the_generator_whatever_the_blocks(disturbed):
    states = [disturbed.state_at(k, q=np.zeros(7)) for k in range(2 * BLOCK_TICKS + 10)]
    measured = _stack(_measured(disturbed, SensorNoiseConfig(position_std_rad=1e-3), states), "q")
    drawn = np.random.default_rng([0, 1]).standard_normal((len(states), 27))[:, :7]
    np.testing.assert_array_equal(measured, 1e-3 * drawn)


@pytest.mark.parametrize("bits", [12, 20])
def test_positions_come_in_whole_counts_of_the_encoder(disturbed, bits):
    rng = np.random.default_rng(0)
    states = [disturbed.state_at(k, q=rng.uniform(-3.0, 3.0, 7)) for k in range(100)]
    measured = _stack(_measured(disturbed, SensorNoiseConfig(**QUIET, position_bits=bits), states), "q")
    step = 2.0 * np.pi / 2**bits
    counts = measured / step
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    error = np.abs(measured - _stack(states, "q"))
    assert 0.45 * step < error.max() <= 0.5 * step * (1 + 1e-9)


@pytest.mark.parametrize("cutoff", [20.0, 100.0, 400.0])
def test_a_differentiated_velocity_is_the_filtered_difference_of_the_measured_positions(disturbed, cutoff):
    t = disturbed.DT * np.arange(800)
    states = [disturbed.state_at(k, q=np.full(7, 0.1 * np.sin(5.0 * x))) for k, x in enumerate(t)]
    config = SensorNoiseConfig(velocity="differentiated", velocity_cutoff_hz=cutoff, position_bits=18)
    measured = _measured(disturbed, config, states)
    q, v = _stack(measured, "q"), _stack(measured, "v")
    keep = np.exp(-2.0 * np.pi * cutoff * disturbed.DT)
    difference = np.diff(q, axis=0, prepend=q[:1]) / disturbed.DT
    np.testing.assert_allclose(v, lfilter([1.0 - keep], [1.0, -keep], difference, axis=0), atol=1e-12)
    np.testing.assert_array_equal(v[0], 0.0)


def test_a_lower_cut_off_trades_noise_for_delay(disturbed):
    states = [disturbed.state_at(k, q=np.full(7, 1e-4 * k)) for k in range(2000)]  # 0.1 rad/s

    def of(cutoff):
        config = SensorNoiseConfig(velocity="differentiated", velocity_cutoff_hz=cutoff)
        return _stack(_measured(disturbed, config, states), "v")

    fast, slow = of(400.0), of(10.0)
    np.testing.assert_allclose([fast[500:].mean(), slow[500:].mean()], 0.1, rtol=1e-3)
    assert slow[500:].std() < 0.1 * fast[500:].std()
    assert slow[10].mean() < 0.6 * fast[10].mean()


def test_a_slow_tracker_holds_its_last_measurement(disturbed):
    states = [disturbed.state_at(k) for k in range(1000)]
    port = _stack(_measured(disturbed, SensorNoiseConfig(port_std_m=1e-5, port_rate_hz=60.0), states), "p_WC")
    new = np.flatnonzero((np.diff(port, axis=0) != 0.0).all(axis=1)) + 1
    assert ((np.diff(port, axis=0) != 0.0).any(axis=1)).sum() == len(new) == 59
    assert set(np.diff(new)) == {16, 17}  # of 16.7 ms
    np.testing.assert_allclose(port[new], _stack(states, "p_WC")[new], atol=1e-4)
    every = _measured(disturbed, SensorNoiseConfig(**QUIET, port_rate_hz=1000.0), states)
    np.testing.assert_array_equal(_stack(every, "p_WC"), _stack(states, "p_WC"))


def test_the_plant_itself_is_not_touched(disturbed):
    noisy, clean = disturbed.plant_of(SensorNoiseConfig(), trocar=True), disturbed.plant_of(trocar=True)
    q = np.full(7, 0.3)
    noisy.reset(q), clean.reset(q)
    for k in range(50):
        state = noisy.step(np.full(7, 0.1 * k), np.zeros(7))
        clean.step(np.full(7, 0.1 * k), np.zeros(7))
    np.testing.assert_array_equal(noisy.truth().q, clean.truth().q)
    assert (state.q != noisy.truth().q).all()


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        (
            "port_rate_hz: 1500.0",
            "port_rate_hz 1500 must be at most one measurement a control period, 1000 Hz",
        ),
        (
            "velocity: differentiated, velocity_cutoff_hz: 600.0",
            "velocity_cutoff_hz 600 must be at most half the control rate, 500 Hz",
        ),
    ],
)
def test_what_the_control_ticks_cannot_follow_is_refused(scenario, keys, message):
    with pytest.raises(ScenarioError, match=message):
        scenario(f"disturbances=[{{type: sensor_noise, {keys}}}]")
