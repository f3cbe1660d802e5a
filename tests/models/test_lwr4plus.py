"""The LWR4+ against values computed by other programs."""

import mujoco
import numpy as np
import pytest

from surgsim.models.build import Scene, build_arm
from surgsim.models.config import RobotConfig, SceneConfig

POSES_DEG = {
    "A": (0, 30, 0, -90, 0, 60, 0),
    "B": (20, -35, 50, 75, -40, 80, 10),
    "C": (-60, 45, -100, 60, 30, -70, 120),
}
# Robotics Toolbox for Python 1.5.0, DHRobot of the classical table: flange position [m], rotation,
# manipulability of the 3x7 and the 6x7 Jacobian, and the Jacobian's z row.
POSITION = {
    "A": (-0.5377499075, 0, 0.3834101615),
    "B": (0.3497461515, 0.4664197442, 0.6533743527),
    "C": (-0.5473274133, 0.1620169175, 0.6786043142),
}
ROTATION = {
    "A": ((-1, 0, 0), (0, 1, 0), (0, 0, -1)),
    "B": (
        (0.2229708474, -0.9694886210, -0.1018617447),
        (0.9118322077, 0.1704677754, 0.3735006861),
        (-0.3447405201, -0.1761605840, 0.9220202939),
    ),
    "C": (
        (-0.2359182551, -0.9021642592, -0.3611678644),
        (-0.0513051662, 0.3827035937, -0.9224455210),
        (0.9704176198, -0.1990919604, -0.1365724513),
    ),
}
MANIPULABILITY = {
    "A": (0.123454918090, 0.103860151643),
    "B": (0.089906939746, 0.097986507390),
    "C": (0.086081214864, 0.096915673381),
}
Z_ROW = {
    "A": (0, -0.5377499075, 0, 0.3377499075, 0, 0, 0),
    "B": (0, 0.4881788254, 0.1827821553, -0.3662883887, 0.0179246179, 0.0240952275, 0),
    "C": (0, -0.4139744731, 0.2778865907, -0.2964356602, 0.0688947661, 0.0243976289, 0),
}
# Pinocchio 4.1 with the unrounded inertial parameters, g = 9.81: gravity torque [N m] and the diagonal of the
# mass matrix [kg m2] without armature.
GRAVITY = {
    "A": (0, -28.253026, -0.202021, 11.318001, -0.353952, -0.005206, 0),
    "B": (0, 27.787077, 5.762014, -11.647872, 0.458220, 0.090006, 0.003769),
    "C": (0, -29.712194, 8.009974, -8.879162, 0.334581, 0.087567, -0.008569),
}
MASS_DIAGONAL = {
    "A": (1.113403, 1.666018, 0.440960, 0.432674, 0.007171, 0.004166, 0.000120),
    "B": (1.238676, 1.718715, 0.404565, 0.425357, 0.007397, 0.004165, 0.000120),
    "C": (1.372208, 1.915593, 0.336188, 0.428841, 0.007280, 0.004144, 0.000120),
}
INVERSE_DYNAMICS_B = (1.370586, 27.346164, 6.205600, -10.895571, 0.425397, 0.088081, 0.003797)
pose = pytest.mark.parametrize("name", POSES_DEG)


@pytest.fixture(scope="module")
def arm() -> Scene:
    return build_arm(SceneConfig(robot=RobotConfig(name="lwr4plus"), instrument=None))


def _at(arm: Scene, name: str) -> mujoco.MjData:
    data = mujoco.MjData(arm.model)
    data.qpos[arm.qpos_ids] = np.radians(POSES_DEG[name])
    mujoco.mj_forward(arm.model, data)
    return data


def _jacobian(arm: Scene, data: mujoco.MjData) -> np.ndarray:
    jacobian = np.zeros((6, arm.model.nv))
    mujoco.mj_jacSite(arm.model, data, jacobian[:3], jacobian[3:], arm.flange_site)
    return jacobian[:, arm.dof_ids]


def _mass_matrix(arm: Scene, data: mujoco.MjData) -> np.ndarray:
    matrix = np.zeros((7, 7))
    mujoco.mj_fullM(arm.model, data, matrix)
    return matrix - np.diag(arm.model.dof_armature)


@pose
def test_flange_has_the_position_and_axes_of_dh_frame_7(arm, name):
    data = _at(arm, name)
    np.testing.assert_allclose(data.site_xpos[arm.flange_site], POSITION[name], atol=1e-9)
    np.testing.assert_allclose(data.site_xmat[arm.flange_site].reshape(3, 3), ROTATION[name], atol=1e-9)


@pose
def test_manipulability_and_jacobian_at_the_flange(arm, name):
    jacobian = _jacobian(arm, _at(arm, name))
    measures = [np.sqrt(np.linalg.det(j @ j.T)) for j in (jacobian[:3], jacobian)]
    np.testing.assert_allclose(measures, MANIPULABILITY[name], atol=1e-9)
    np.testing.assert_allclose(jacobian[2], Z_ROW[name], atol=1e-9)


@pose
def test_gravity_and_mass_matrix(arm, name):
    data = _at(arm, name)
    np.testing.assert_allclose(data.qfrc_bias, GRAVITY[name], atol=1e-3)
    np.testing.assert_allclose(np.diag(_mass_matrix(arm, data)), MASS_DIAGONAL[name], atol=1e-3, rtol=1e-3)


def test_inverse_dynamics(arm):
    data = _at(arm, "B")
    data.qvel[:] = (0.3, -0.2, 0.5, 0.1, -0.4, 0.6, -0.3)
    mujoco.mj_forward(arm.model, data)
    torque = _mass_matrix(arm, data) @ (1, -0.5, 0.2, 0.8, -1.2, 0.4, 2) + data.qfrc_bias
    np.testing.assert_allclose(torque, INVERSE_DYNAMICS_B, atol=1e-3)


def test_at_zero_the_arm_stands_straight_up_and_its_frames_are_the_base_s(arm):
    data = mujoco.MjData(arm.model)
    mujoco.mj_forward(arm.model, data)
    np.testing.assert_allclose(data.site_xpos[arm.flange_site], (0, 0, 1.178), atol=1e-12)
    np.testing.assert_allclose(data.xmat.reshape(-1, 3, 3), np.broadcast_to(np.eye(3), (9, 3, 3)), atol=1e-12)
    axes = [(0, 0, 1), (0, -1, 0), (0, 0, 1), (0, 1, 0), (0, 0, 1), (0, -1, 0), (0, 0, 1)]
    np.testing.assert_allclose(data.xaxis, axes, atol=1e-12)


def test_limits(arm):
    limits = arm.limits
    np.testing.assert_allclose(np.degrees(limits.q_max), [170, 120, 170, 120, 170, 120, 170])
    np.testing.assert_allclose(limits.q_min, -limits.q_max)
    np.testing.assert_allclose(np.degrees(limits.velocity), [110, 110, 128, 128, 204, 184, 184])
    np.testing.assert_allclose(limits.acceleration, 5.236, atol=1e-3)
    np.testing.assert_allclose(limits.torque, [176, 176, 100, 100, 100, 38, 38])


def test_assumed_drive_constants(arm):
    np.testing.assert_allclose(arm.model.dof_armature, 0.1)
    np.testing.assert_allclose(np.ravel(arm.model.dof_damping), [1, 1, 1, 1, 0.3, 0.3, 0.3])
    np.testing.assert_allclose(arm.model.dof_frictionloss, 0)


def test_total_mass(arm):
    assert arm.model.body_mass.sum() == pytest.approx(16.0, abs=1e-9)
