"""Filters against tremor: their frequency response by its formula, and what is left at the tip."""

import numpy as np
import pytest
from pydantic import ValidationError
from scipy import signal

from surgsim.errors import SurgsimError
from surgsim.metrics.catalog import METRICS
from surgsim.metrics.operating import tremor_rms
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import prepare
from surgsim.tasks.teleoperation import TeleoperationConfig
from surgsim.teleop.bilateral.wave_variables import WaveVariablesConfig
from surgsim.teleop.tremor_filter import (
    TremorFilter,
    TremorFilterConfig,
    TremorFilterLaw,
    describe_filter,
    steady,
)
from surgsim.tick.arrays import new

T = 0.001
LOW_PASS, COMB = TremorFilterConfig(type="low_pass"), TremorFilterConfig(type="bmflc")


def filtered(config, positions):
    law, state = new(TremorFilterLaw, 0), new(TremorFilter, 0)
    describe_filter(law, config, T)
    found, velocities = positions.copy(), np.full(positions.shape, np.nan)
    for k, (position, velocity) in enumerate(zip(found, velocities, strict=True)):
        steady(law, state, T * k, position, velocity)
    return found, velocities


def waves(frequency_hz, rows=12_000):
    phase = 2.0 * np.pi * frequency_hz * T * np.arange(rows)
    return 0.3 + 0.01 * np.column_stack([np.sin(phase), np.sin(phase), 2.0 * np.sin(phase)])


def response(config, frequency_hz):
    """Gain and phase [rad] at a frequency, fitted to the last seconds, and what a formula has for it."""
    found, _ = filtered(config, waves(frequency_hz))
    phase = 2.0 * np.pi * frequency_hz * T * np.arange(len(found))[-5000:]
    basis = np.column_stack([np.sin(phase), np.cos(phase), np.ones(5000)])
    sine, cosine, _ = np.linalg.lstsq(basis, found[-5000:, 2], rcond=None)[0] / 0.02
    return sine + 1j * cosine


@pytest.mark.parametrize("frequency", [0.5, 3.0, 7.0, 10.0, 20.0])
def test_the_low_pass_is_butterworth_s(frequency):
    b, a = signal.butter(2, 7.0, fs=1.0 / T)
    _, expected = signal.freqz(b, a, [frequency], fs=1.0 / T)
    assert response(LOW_PASS, frequency) == pytest.approx(expected[0], abs=2e-3)


@pytest.mark.parametrize("frequency", [0.5, 3.0, 5.0, 10.0, 20.0])
def test_the_comb_has_the_response_of_its_recursion(frequency):
    """Sines of a fixed band whose weights follow the error are a linear filter (Glover, 1977)."""
    z, mu, band = np.exp(2j * np.pi * frequency * T), 2e-3, 2.0 * np.pi * np.arange(7.0, 13.01, 0.5) * T
    with np.errstate(divide="ignore", invalid="ignore"):
        loop = 2.0 * mu * np.sum((z * np.cos(band) - 1.0) / (z * z - 2.0 * z * np.cos(band) + 1.0))
    expected = 0.0 if frequency == 10.0 else (1.0 - mu * 13) / (1.0 + loop)
    assert response(COMB, frequency) == pytest.approx(expected, abs=5e-3)


@pytest.mark.parametrize("config", [LOW_PASS, COMB], ids=["low_pass", "bmflc"])
def test_the_velocity_is_that_of_the_position_and_a_place_is_kept(config):
    positions = np.zeros((6000, 3))
    positions[:, 0] = 0.4 + 0.05 * np.clip(T * np.arange(6000) - 0.5, 0.0, 1.0)
    found, velocities = filtered(config, positions)
    assert velocities[1:] == pytest.approx(np.diff(found, axis=0) / T, abs=1e-9)
    assert found[-1] == pytest.approx(positions[-1], abs=1e-5)
    assert found[0] == pytest.approx(positions[0], abs=0.0)


def test_no_filter_leaves_every_bit():
    positions = waves(3.0, 50)
    found, velocities = filtered(TremorFilterConfig(), positions)
    assert np.array_equal(found, positions)
    assert np.isnan(velocities).all()


def test_the_metric_is_the_rms_in_the_band():
    times = T * np.arange(8000)
    velocity = np.zeros((8000, 3))
    for hz, amplitude in ((0.4, 0.03), (10.0, 1e-4), (25.0, 1e-3)):
        velocity[:, 1] += 2.0 * np.pi * hz * amplitude * np.cos(2.0 * np.pi * hz * times)
    assert tremor_rms(velocity, T) == pytest.approx(1e-4 / 2**0.5, rel=0.02)
    assert np.isnan(tremor_rms(velocity[:900], T))


def test_less_tremor_arrives_at_the_tip_and_the_account_agrees():
    left = {}
    for kind in ("none", "bmflc", "low_pass"):
        keys = (f"task.tremor_filter.type={kind}", "task.duration_s=6.0")
        run = Simulation(prepare(load_scenario("teleop_free_motion_panda", assignments=keys))).run()
        names = ("tremor_tip_rms_mm", "tremor_transmission", "energy_residual_fraction")
        left[kind] = [METRICS[name].compute(run) for name in names]
        assert left[kind][2] < 0.01
        assert np.abs(run["tank_account_residual_j"]).max() < 1e-10
        assert METRICS["delivered_excess_j"].compute(run) < 0.0
    assert left["none"][1] == pytest.approx(1.0, abs=0.05)
    assert left["low_pass"][1] < left["bmflc"][1] < 0.75
    assert left["bmflc"][0] < 0.75 * left["none"][0]


def test_what_a_filter_cannot_do_is_refused():
    with pytest.raises(ValidationError, match=r"by 0.1 must be 1 to 32 frequencies, not 61"):
        TremorFilterConfig(step_hz=0.1)
    with pytest.raises(ValidationError, match=r"tremor_filter needs .*: 'wave_variables' takes what"):
        TeleoperationConfig(bilateral=WaveVariablesConfig(), tremor_filter=COMB)
    keys = ("task.tremor_filter={type: low_pass, cutoff_hz: 200}",)
    with pytest.raises(SurgsimError, match=r"tremor_filter.cutoff_hz 200 must be below 100, a tenth"):
        load_scenario("teleop_free_motion_panda", assignments=keys)
    keys = (
        "task.tremor_filter={type: bmflc, lowest_hz: 2, highest_hz: 8, step_hz: 0.2, adaptation_per_s: 5}",
        "simulation={timestep_s: 0.001, control_period_s: 0.01}",
    )
    with pytest.raises(SurgsimError, match=r"adaptation_per_s 5 is too fast for 31 .* at most 1.61"):
        load_scenario("teleop_free_motion_panda", assignments=keys)
