"""The instrument's tracker: the true pose, its noise at the markers, its rate, delay, losses and field."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surgsim.errors import ScenarioError
from surgsim.plant.disturbances.instrument_tracker import (
    FIELD,
    FIELD_ANGLE,
    FIRST_WAVE,
    WAVES,
    InstrumentTrackerConfig,
)
from surgsim.plant.state import NOT_TRACKED
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import prepare

QUIET = "position_std_m: 0, angle_std_rad: 0"
CALIBRATION = "{type: calibration_error}"


@pytest.fixture
def watch(scenario):
    """Measured poses and true ones (ticks), while an arm with errors moves; the tracker's gains."""

    def run(tracker, ticks=200, others=(CALIBRATION,), seed=1):
        parts = ", ".join([*others, f"{{type: instrument_tracker{tracker}}}"])
        keys = (f"disturbances=[{parts}]", "task.duration_s=3", "simulation.timestep_s=0.0005")
        setup = prepare(scenario(*keys, controller="rcm_inverse_dynamics", seed=seed))
        simulation, plant, site = Simulation(setup), setup.plant, setup.plant.world.tip
        seen, true = [], []
        for _ in range(ticks):
            seen.append(plant.state().tracked)
            data = plant.data
            true.append((data.site_xpos[site].copy(), data.site_xmat[site].reshape(3, 3).copy()))
            simulation.tick()
        return seen, true, plant.parts[-1].gains

    return run


def sampled(seen):
    """Ticks at which a new sample was given."""
    counts = np.array([pose.samples for pose in seen])
    return np.flatnonzero(np.diff(counts, prepend=0))


def test_without_noise_it_is_the_true_pose_and_holds_between_samples(watch):
    seen, true, _ = watch(f", {QUIET}, rate_hz: 200")
    assert sampled(seen).tolist() == list(range(0, 200, 5))
    for k, pose in enumerate(seen):
        p, R = true[k - k % 5]
        assert pose.samples == k // 5 + 1
        assert pose.age_s == pytest.approx(1e-3 * (k % 5))
        np.testing.assert_allclose(pose.p_WT, p, rtol=0.0, atol=1e-14)
        np.testing.assert_allclose(pose.R_WT, R, rtol=0.0, atol=1e-14)
    assert np.ptp([p for p, _ in true], axis=0).max() > 1e-4


@pytest.mark.parametrize("delay", [1, 4, 12, 23])
def test_a_late_sample_says_how_old_it_is(watch, delay):
    seen, true, _ = watch(f", {QUIET}, rate_hz: 200, delay_s: {1e-3 * delay:g}")
    assert all(pose.samples == 0 and np.isnan(pose.p_WT).all() for pose in seen[:delay])
    assert sampled(seen).tolist() == list(range(delay, 200, 5))
    for k, pose in enumerate(seen[delay:], delay):
        taken = (k - delay) // 5 * 5
        assert pose.age_s == pytest.approx(1e-3 * (k - taken))
        np.testing.assert_allclose(pose.p_WT, true[taken][0], rtol=0.0, atol=1e-14)


def test_the_sensors_delay_leaves_sample_and_joints_of_one_time_together(watch):
    seen, true, _ = watch(f", {QUIET}, rate_hz: 200", others=("{type: sensor_delay, delay_s: 0.003}",))
    for k, pose in enumerate(seen[3:], 3):
        assert pose.age_s == pytest.approx(1e-3 * ((k - 3) % 5))
        np.testing.assert_allclose(pose.p_WT, true[k - 3 - (k - 3) % 5][0], rtol=0.0, atol=1e-14)


def test_noise_is_white_at_the_markers(watch):
    seen, true, _ = watch(
        ", rate_hz: 1000, position_std_m: 1.0e-4, angle_std_rad: 2.0e-3, markers_from_tip_m: 0.3", 2500
    )
    place, turn = [], []
    for pose, (p, R) in zip(seen, true, strict=True):
        place.append(pose.p_WT - 0.3 * pose.R_WT[:, 2] - (p - 0.3 * R[:, 2]))
        turn.append(Rotation.from_matrix(R.T @ pose.R_WT).as_rotvec())
    errors = np.hstack((place, turn))
    np.testing.assert_allclose(errors.std(axis=0), np.repeat([1e-4, 2e-3], 3), rtol=0.06)
    correlation = np.corrcoef(np.hstack((errors[1:], errors[:-1])).T)
    assert np.abs(correlation - np.eye(12)).max() < 0.1
    across = np.std([pose.p_WT - p for pose, (p, _) in zip(seen, true, strict=True)])
    assert across > 3e-4  # the lever of 0.3 m makes more of it at the tip


def test_it_is_lost_for_good(watch):
    seen, _, _ = watch(f", {QUIET}, rate_hz: 100, lost_after_s: 0.05")
    assert sampled(seen).tolist() == [0, 10, 20, 30, 40]
    assert seen[-1].age_s == pytest.approx(0.159)


def test_frames_are_missed_with_the_probability(watch):
    seen, _, _ = watch(", rate_hz: 1000, dropout: 0.3", 2000)
    assert seen[-1].samples / 2000 == pytest.approx(0.7, abs=0.03)
    gaps = np.diff(sampled(seen))
    assert np.mean(gaps == 1) == pytest.approx(0.7, abs=0.05)


def field_of(gains, places):
    """The field's error (k, 6) at places (k, 3), by its formula."""
    waves = gains[FIRST_WAVE:].reshape(6, WAVES, 4)
    phases = np.einsum("ijk,pk->pij", waves[:, :, :3], places) + waves[:, :, 3]
    return np.repeat(gains[[FIELD, FIELD_ANGLE]], 3) * np.sin(phases).sum(axis=2) / np.sqrt(WAVES)


def test_the_field_is_as_large_as_a_wave_and_no_shorter(disturbed):
    config = InstrumentTrackerConfig(field_m=1e-4, field_angle_rad=3e-4, field_length_m=0.3)
    gains = disturbed.started(config, seed=3).part.gains
    places = np.random.default_rng(0).uniform(-2.0, 2.0, (4000, 3))
    error = field_of(gains, places)
    np.testing.assert_allclose(error.std(axis=0), np.repeat([1e-4, 3e-4], 3) / np.sqrt(2.0), rtol=0.1)
    step = 1e-6 * np.array([1.0, 0.0, 0.0])
    slope = np.abs(field_of(gains, places + step) - error).max(axis=0) / 1e-6
    assert (slope <= np.sqrt(WAVES) * np.repeat([1e-4, 3e-4], 3) * 2.0 * np.pi / 0.3).all()


def test_the_field_is_static_and_of_the_place_of_the_markers(watch):
    keys = f", {QUIET}, rate_hz: 1000, field_m: 1.0e-3, field_angle_rad: 1.0e-3, markers_from_tip_m: 0.4"
    seen, true, gains = watch(keys, 300)
    again, _, _ = watch(keys + ", dropout: 0.2", 300)
    _, _, others = watch(keys, 1, seed=2)
    markers = np.array([p - 0.4 * R[:, 2] for p, R in true])
    wanted = field_of(gains, markers)
    off = [pose.p_WT - 0.4 * pose.R_WT[:, 2] for pose in seen] - markers
    turns = [
        Rotation.from_matrix(R.T @ pose.R_WT).as_rotvec() for pose, (_, R) in zip(seen, true, strict=True)
    ]
    np.testing.assert_allclose(np.hstack((off, turns)), wanted, rtol=0.0, atol=1e-12)
    assert np.abs(wanted).max() > 3e-4
    np.testing.assert_array_equal(seen[0].p_WT, again[0].p_WT)
    assert (gains[FIRST_WAVE:] != others[FIRST_WAVE:]).all()


def test_markers_at_the_upper_end_do_not_see_the_shaft_bend(watch):
    push = "{type: push, force_n: [0.0, 3.0, 0.0], start_s: 0.0, duration_s: 1.0}"
    seen, true, _ = watch(f", {QUIET}, rate_hz: 1000", others=("{type: bending_shaft}", push))
    off = np.array([pose.p_WT - p for pose, (p, _) in zip(seen, true, strict=True)])
    assert np.linalg.norm(off[0]) < 1e-4
    assert np.linalg.norm(off, axis=1).max() > 1e-3


def test_without_a_tracker_nothing_is_tracked(scenario):
    setup = prepare(scenario("disturbances=[{type: sensor_noise}]"))
    assert setup.plant.reset(setup.q_start).tracked == NOT_TRACKED


def test_a_second_run_does_not_see_the_first_one_s_samples(scenario):
    setup = prepare(scenario("disturbances=[{type: instrument_tracker, delay_s: 0.01}]"))
    Simulation(setup).run()
    assert setup.plant.reset(setup.q_start).tracked == NOT_TRACKED


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ("rate_hz: 1500", "rate_hz 1500 must be at most one measurement a control period, 1000 Hz"),
        ("delay_s: 0.0015", "delay_s 0.0015 must be a whole multiple of control_period_s 0.001"),
    ],
)
def test_what_ticks_cannot_follow_is_refused(scenario, keys, message):
    with pytest.raises(ScenarioError, match=message):
        scenario(f"disturbances=[{{type: instrument_tracker, {keys}}}]")
