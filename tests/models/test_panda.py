"""The Panda's limits, drives and mass; its kinematics and dynamics are in test_published_arms.py."""

import mujoco
import numpy as np
import pytest
from published_arms import FRANKA_DH, PANDA

from surgsim.models.build import Scene, build_arm
from surgsim.models.config import RobotConfig, SceneConfig


@pytest.fixture(scope="module")
def arm() -> Scene:
    return build_arm(SceneConfig(robot=RobotConfig(name="panda"), instrument=None))


@pytest.mark.parametrize("name", ["panda", "fr3"])
def test_every_link_frame_is_its_dh_frame(name):
    model = build_arm(SceneConfig(robot=RobotConfig(name=name), instrument=None)).model
    data = mujoco.MjData(model)
    data.qpos[:] = (0.6, -0.9, 1.1, -1.7, -0.8, 1.9, 0.4)
    mujoco.mj_forward(model, data)
    assert PANDA.placements is FRANKA_DH
    for i, frame in enumerate(PANDA.frames(data.qpos)):
        body = model.body(f"link{i + 1}").id
        np.testing.assert_allclose(data.xpos[body], frame[:3, 3], atol=1e-12)
        np.testing.assert_allclose(data.xmat[body].reshape(3, 3), frame[:3, :3], atol=1e-12)


def test_at_zero_the_flange_looks_down_in_front_of_the_base(arm):
    data = mujoco.MjData(arm.model)
    mujoco.mj_forward(arm.model, data)
    np.testing.assert_allclose(data.site_xpos[arm.flange_site], (0.088, 0, 1.033 - 0.107), atol=1e-12)
    np.testing.assert_allclose(data.site_xmat[arm.flange_site].reshape(3, 3)[:, 2], (0, 0, -1), atol=1e-12)


def test_limits(arm):
    limits = arm.limits
    np.testing.assert_array_equal(limits.q_max, [2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973])
    np.testing.assert_array_equal(
        limits.q_min, [-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973]
    )
    np.testing.assert_array_equal(limits.velocity, [2.175] * 4 + [2.61] * 3)
    np.testing.assert_array_equal(limits.acceleration, [15, 7.5, 10, 12.5, 15, 20, 20])
    np.testing.assert_array_equal(limits.jerk, 500 * limits.acceleration)
    np.testing.assert_array_equal(limits.torque, [87] * 4 + [12] * 3)
    np.testing.assert_array_equal(limits.torque_rate, 1000)


def test_assumed_drive_constants(arm):
    np.testing.assert_array_equal(arm.model.dof_armature, 0.1)
    np.testing.assert_array_equal(np.ravel(arm.model.dof_damping), 1)
    np.testing.assert_array_equal(arm.model.dof_frictionloss, 0)


def test_total_mass(arm):
    assert arm.model.body_mass.sum() == pytest.approx(0.629769 + sum(PANDA.masses), abs=1e-12)
