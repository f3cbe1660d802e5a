"""Gravity error: the weight of every link along the leaning, scaled gravity."""

import mujoco
import numpy as np
import pytest

from surgsim.plant.disturbances.gravity_error import GravityErrorConfig

G = 9.81


def test_gravity_leans_towards_its_heading_and_is_scaled(disturbed):
    scene, _ = disturbed.scene_of(GravityErrorConfig(tilt_rad=0.1, heading_rad=0.7, scale=1.2))
    expected = 1.2 * G * np.array([np.sin(0.1) * np.cos(0.7), np.sin(0.1) * np.sin(0.7), -np.cos(0.1)])
    np.testing.assert_allclose(scene.model.opt.gravity, expected, atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_joints_carry_the_weight_of_the_bodies_along_it(disturbed, random_q, seed):
    """A body's weight at its centre of mass, from geometry alone."""
    q = random_q(np.random.default_rng(seed))
    scene, _ = disturbed.scene_of(GravityErrorConfig(tilt_rad=0.05, heading_rad=-2.0, scale=0.9))
    g = 0.9 * G * np.array([np.sin(0.05) * np.cos(-2.0), np.sin(0.05) * np.sin(-2.0), -np.cos(0.05)])
    data = mujoco.MjData(scene.model)
    data.qpos[:] = q
    mujoco.mj_forward(scene.model, data)
    torque = np.zeros(7)
    for body in range(1, scene.model.nbody):
        J = np.zeros((3, scene.model.nv))
        mujoco.mj_jac(scene.model, data, J, None, data.xipos[body], body)
        torque -= J.T @ g * scene.model.body_mass[body]
    np.testing.assert_allclose(disturbed.inertia(scene, q)[1], torque, atol=1e-9)


def test_nothing_is_exactly_nothing(disturbed):
    scene, _ = disturbed.scene_of(GravityErrorConfig(tilt_rad=0.0))
    np.testing.assert_array_equal(scene.model.opt.gravity, [0.0, 0.0, -G])


def test_tilt_scale_and_heading_are_drawn_from_the_seed(disturbed):
    config = GravityErrorConfig(tilt_rad=0.02, scale=1.1, direction="random", spread=0.5)

    def gravity(seed):
        return np.array(disturbed.scene_of(config, seed=seed)[0].model.opt.gravity)

    drawn = np.array([gravity(seed) for seed in range(30)])
    size = np.linalg.norm(drawn, axis=1)
    tilt = np.arccos(-drawn[:, 2] / size)
    for values, low, high in ((size / G, 1.05, 1.15), (tilt, 0.01, 0.03)):
        assert low - 1e-9 <= values.min()
        assert values.max() <= high + 1e-9
        assert np.ptp(values) > 0.5 * (high - low)
    assert len(np.unique(np.round(np.arctan2(drawn[:, 1], drawn[:, 0]), 6))) == 30
    np.testing.assert_array_equal(gravity(4), drawn[4])
