"""Every catalogued path task: derivatives, rest at both ends, its place and its dimensions."""

import re

import numpy as np
import pytest
from pydantic import ValidationError

from surgsim.tasks import TASKS
from surgsim.tasks.base import PathTaskConfig

PATHS = [name for name in TASKS.names() if issubclass(TASKS.config(name), PathTaskConfig)]
START = np.array([0.1, -0.4, 0.2])
every_path = pytest.mark.parametrize("name", PATHS)


def _tilted(name, seed, **given):
    rng = np.random.default_rng(seed)
    normal, direction = rng.standard_normal((2, 3)).tolist()
    return TASKS.config(name)(normal=tuple(normal), direction=tuple(direction), **given)


def _points(task, count=4001):
    return np.array([task.command(t).p_WTd for t in np.linspace(0.0, task.duration_s, count)])


@every_path
@pytest.mark.parametrize("seed", [0, 1])
def test_velocity_and_acceleration_are_the_derivatives_of_the_position(name, seed):
    task, h = _tilted(name, seed, duration_s=4.0).build(START), 1e-5
    moving = 0
    for t in np.random.default_rng(seed).uniform(0.0, task.duration_s, 30):
        before, now, after = (task.command(t + dt) for dt in (-h, 0.0, h))
        speed = (after.p_WTd - before.p_WTd) / (2 * h)
        acceleration = (after.v_WTd - before.v_WTd) / (2 * h)
        np.testing.assert_allclose(now.v_WTd, speed, atol=1e-8)
        np.testing.assert_allclose(now.a_WTd, acceleration, atol=1e-5)
        moving += np.linalg.norm(speed) > 1e-3
    assert moving > 15


@every_path
def test_it_starts_at_its_start_and_is_at_rest_at_both_ends(name):
    config = _tilted(name, 3, duration_s=2.0, hold_start_s=0.4, hold_end_s=0.7)
    task = config.build(START)
    assert task.duration_s == pytest.approx(3.1)
    for t in (0.0, 0.4, 2.4, 3.1, 99.0):
        command = task.command(t)
        np.testing.assert_allclose(command.v_WTd, 0.0, atol=1e-15)
        np.testing.assert_allclose(command.a_WTd, 0.0, atol=1e-15)
    np.testing.assert_array_equal(task.command(0.0).p_WTd, START)
    np.testing.assert_array_equal(task.command(0.4).p_WTd, START)
    np.testing.assert_allclose(task.command(3.1).p_WTd, task.command(2.4).p_WTd, atol=1e-15)


@every_path
def test_velocity_and_acceleration_are_continuous(name):
    task = _tilted(name, 4, duration_s=4.0, ramp_s=0.5).build(START)
    times = np.arange(0.0, task.duration_s, 1e-3)
    a = np.array([task.command(t).a_WTd for t in times])
    v = np.array([task.command(t).v_WTd for t in times])
    assert np.abs(np.diff(v, axis=0)).max() <= 1.1e-3 * np.abs(a).max()
    assert np.abs(np.diff(a, axis=0)).max() < 0.05 * np.abs(a).max()


def _in_plane(points, config):
    """Coordinates along the direction made normal, across it, and along the normal, from the start."""
    z = np.array(config.normal) / np.linalg.norm(config.normal)
    x = np.array(config.direction) - z * (z @ np.array(config.direction))
    x = x / np.linalg.norm(x)
    return (points - START) @ np.column_stack([x, np.cross(z, x), z])


@pytest.mark.parametrize("seed", [0, 1])
def test_circle_has_its_radius_and_closes(seed):
    config = _tilted("circle", seed, radius_m=0.03, turns=2.0)
    p = _in_plane(_points(config.build(START)), config)
    np.testing.assert_allclose(np.hypot(p[:, 0] + 0.03, p[:, 1]), 0.03, atol=1e-12)
    np.testing.assert_allclose(p[:, 2], 0.0, atol=1e-12)
    np.testing.assert_allclose(p[-1], 0.0, atol=1e-12)
    assert np.linalg.norm(np.diff(p, axis=0), axis=1).sum() == pytest.approx(2 * 2 * np.pi * 0.03, rel=1e-4)
    assert p[100:400, 1].mean() > 0  # counter-clockwise about the normal


@pytest.mark.parametrize("seed", [0, 1])
def test_sinusoid_has_its_length_amplitude_and_periods(seed):
    config = _tilted("sinusoid", seed, amplitude_m=0.02, length_m=0.1, periods=3.0)
    p = _in_plane(_points(config.build(START)), config)
    assert np.ptp(p[:, 0]) == pytest.approx(0.1)
    assert p[:, 1].max() == pytest.approx(0.02, rel=1e-4)
    assert p[:, 1].min() == pytest.approx(-0.02, rel=1e-4)
    np.testing.assert_allclose(p[:, 2], 0.0, atol=1e-12)
    np.testing.assert_allclose(p[:, 1], 0.02 * np.sin(2 * np.pi * 3 * p[:, 0] / 0.1), atol=1e-12)


@pytest.mark.parametrize("seed", [0, 1])
def test_spiral_has_its_radius_length_and_turns(seed):
    config = _tilted("spiral", seed, radius_m=0.01, length_m=0.05, turns=4.0)
    p = _in_plane(_points(config.build(START)), config)
    np.testing.assert_allclose(np.hypot(p[:, 0] + 0.01, p[:, 1]), 0.01, atol=1e-12)
    assert p[-1, 2] == pytest.approx(0.05)
    assert (np.diff(p[:, 2]) >= -1e-15).all()
    length = np.hypot(2 * np.pi * 0.01 * 4, 0.05)
    assert np.linalg.norm(np.diff(p, axis=0), axis=1).sum() == pytest.approx(length, rel=1e-4)


def test_default_dimensions_are_those_of_table_1_of_the_manipulability_paper():
    circle, sinusoid, spiral = (TASKS.config(name)() for name in ("circle", "sinusoid", "spiral"))
    assert circle.radius_m == 0.02
    assert (sinusoid.amplitude_m, sinusoid.length_m) == (0.01, 0.25)
    assert (spiral.radius_m, spiral.length_m) == (0.01, 0.05)


BAD = [
    ({"ramp_s": 5.1}, "ramp_s 5.1 must be at most half of duration_s 10"),
    ({"normal": (0.0, 0.0, 0.0)}, "finite non-zero vector"),
    ({"normal": (0.0, 0.0, 1.0), "direction": (0.0, 0.0, -2.0)}, "parallel to the plane's normal"),
    ({"direction": (0.0, 0.0, 0.0), "normal": (0.0, 0.0, 1.0)}, "direction"),
    ({"duration_s": 0.0}, "greater than 0"),
    ({"ramp_s": 0.0}, "greater than 0"),
    ({"hold_end_s": -0.1}, "greater than or equal to 0"),
    ({"duration_s": float("inf")}, "finite"),
    ({"start_m": (0.0, float("nan"), 0.0)}, "finite"),
    ({"radius": 0.1}, "Extra inputs are not permitted"),
]


@every_path
@pytest.mark.parametrize(("given", "text"), BAD, ids=[str(given) for given, _ in BAD])
def test_bad_configs_are_refused(name, given, text):
    with pytest.raises(ValidationError, match=re.escape(text)):
        TASKS.config(name)(**given)
