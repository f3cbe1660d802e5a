"""The Panda against its published tables, by kinematics and dynamics written here from modified DH."""

import mujoco
import numpy as np
import pytest

from surgsim.models.build import GRAVITY_M_PER_S2, Scene, build_arm
from surgsim.models.config import RobotConfig, SceneConfig
from surgsim.scenario.load import load_scenario, shipped
from surgsim.simulate.loop import simulate

# Franka Control Interface documentation: modified (Craig) DH of joints 1 to 7 and the flange.
A = (0, 0, 0, 0.0825, -0.0825, 0, 0.088)
D = (0.333, 0, 0.316, 0, 0.384, 0, 0)
ALPHA = (0, -np.pi / 2, np.pi / 2, np.pi / 2, -np.pi / 2, np.pi / 2, np.pi / 2)
FLANGE_M = 0.107
# Gaz et al. 2019 as in MuJoCo Menagerie, links 1 to 7: mass [kg], centre of mass [m] and inertia about it
# [kg m2] (xx yy zz xy xz yz), both in the DH frame.
MASS = (4.970684, 0.646926, 3.228604, 3.587895, 1.225946, 1.666555, 0.735522)
COM = (
    (0.003875, 0.002081, -0.04762),
    (-0.003141, -0.02872, 0.003495),
    (0.027518, 0.039252, -0.066502),
    (-0.05317, 0.104419, 0.027454),
    (-0.011953, 0.041065, -0.038437),
    (0.060149, -0.014117, -0.010517),
    (0.010517, -0.004252, 0.061597),
)
INERTIA = (
    (0.70337, 0.70661, 0.009117, -0.000139, 0.006772, 0.019169),
    (0.007962, 0.02811, 0.025995, -0.003925, 0.010254, 0.000704),
    (0.037242, 0.036155, 0.01083, -0.004761, -0.011396, -0.012805),
    (0.025853, 0.019552, 0.028323, 0.007796, -0.001332, 0.008641),
    (0.035549, 0.029474, 0.008627, -0.002117, -0.004037, 0.000229),
    (0.001964, 0.004354, 0.005433, 0.000109, -0.001158, 0.000341),
    (0.012516, 0.010027, 0.004815, -0.000428, -0.001196, -0.000741),
)
POSES = {
    "ready": (0, -np.pi / 4, 0, -3 * np.pi / 4, 0, np.pi / 2, np.pi / 4),
    "bent": (0.6, -0.9, 1.1, -1.7, -0.8, 1.9, 0.4),
    "turned": (-2.1, 0.7, -1.6, -2.6, 2.2, 0.6, -1.9),
}
SHORT = (
    "theatre=false",
    "task.duration_s=1.0",
    "task.ramp_s=0.4",
    "task.hold_end_s=0.0",
    "task.radius_m=0.002",
)
pose = pytest.mark.parametrize("q", POSES.values(), ids=POSES)


@pytest.fixture(scope="module")
def arm() -> Scene:
    return build_arm(SceneConfig(robot=RobotConfig(name="panda"), instrument=None))


def _at(arm: Scene, q) -> mujoco.MjData:
    data = mujoco.MjData(arm.model)
    data.qpos[arm.qpos_ids] = q
    mujoco.mj_forward(arm.model, data)
    return data


def _dh_frames(q) -> list[np.ndarray]:
    """Poses (4, 4) of links 1 to 7: the product of Rx(alpha) Tx(a) Rz(q) Tz(d)."""
    frames, pose = [], np.eye(4)
    for alpha, a, angle, d in zip(ALPHA, A, q, D, strict=True):
        ca, sa, c, s = np.cos(alpha), np.sin(alpha), np.cos(angle), np.sin(angle)
        pose = pose @ [
            [c, -s, 0, a],
            [s * ca, c * ca, -sa, -d * sa],
            [s * sa, c * sa, ca, d * ca],
            [0, 0, 0, 1],
        ]
        frames.append(pose)
    return frames


def _flange(q) -> np.ndarray:
    return _dh_frames(q)[-1] @ [0, 0, FLANGE_M, 1]


def _slope(function, q, h=1e-6) -> np.ndarray:
    """Central differences of `function` along the seven joints, in the last axis."""
    steps = h * np.eye(7)
    return np.stack([(function(q + step) - function(q - step)) / (2 * h) for step in steps], axis=-1)


def _centres(q, com=COM) -> np.ndarray:
    """Centres of mass (7, 3) [m] of links 1 to 7."""
    return np.array([(T @ [*c, 1])[:3] for T, c in zip(_dh_frames(q), com, strict=True)])


def _potential_energy(q, com=COM) -> float:
    return float(np.dot(MASS, _centres(q, com)[:, 2]) * GRAVITY_M_PER_S2)


def _mass_matrix(q) -> np.ndarray:
    """Sum over the links of Jv' m Jv + Jw' R I R' Jw, without armature."""
    frames, Jv, M = _dh_frames(q), _slope(_centres, np.array(q)), np.zeros((7, 7))
    for i, (T, m, (xx, yy, zz, xy, xz, yz)) in enumerate(zip(frames, MASS, INERTIA, strict=True)):
        R, Jw = T[:3, :3], np.zeros((3, 7))
        Jw[:, : i + 1] = np.stack([frame[:3, 2] for frame in frames[: i + 1]], axis=1)
        inertia = R @ [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]] @ R.T
        M += m * Jv[i].T @ Jv[i] + Jw.T @ inertia @ Jw
    return M


@pose
def test_every_link_frame_is_its_dh_frame_and_turns_about_its_z(arm, q):
    data = _at(arm, q)
    for i, frame in enumerate(_dh_frames(q)):
        body = arm.model.body(f"link{i + 1}").id
        np.testing.assert_allclose(data.xpos[body], frame[:3, 3], atol=1e-12)
        np.testing.assert_allclose(data.xmat[body].reshape(3, 3), frame[:3, :3], atol=1e-12)
        np.testing.assert_allclose(data.xaxis[arm.dof_ids[i]], frame[:3, 2], atol=1e-12)


@pose
def test_the_flange_is_107_mm_along_link_7_with_its_axes(arm, q):
    data = _at(arm, q)
    np.testing.assert_allclose(data.site_xpos[arm.flange_site], _flange(q)[:3], atol=1e-12)
    np.testing.assert_allclose(
        data.site_xmat[arm.flange_site].reshape(3, 3), _dh_frames(q)[-1][:3, :3], atol=1e-12
    )


def test_at_zero_the_flange_looks_down_in_front_of_the_base(arm):
    data = _at(arm, np.zeros(7))
    np.testing.assert_allclose(data.site_xpos[arm.flange_site], (0.088, 0, 1.033 - 0.107), atol=1e-12)
    np.testing.assert_allclose(data.site_xmat[arm.flange_site].reshape(3, 3)[:, 2], (0, 0, -1), atol=1e-12)


@pose
def test_the_jacobian_is_the_slope_of_the_flange_s_position(arm, q):
    jacobian = np.zeros((3, arm.model.nv))
    mujoco.mj_jacSite(arm.model, _at(arm, q), jacobian, None, arm.flange_site)
    slope = _slope(lambda x: _flange(x)[:3], np.array(q))
    np.testing.assert_allclose(jacobian[:, arm.dof_ids], slope, atol=1e-9)


@pose
def test_gravity_torque_is_the_slope_of_the_potential_energy(arm, q):
    torque = _at(arm, q).qfrc_bias[arm.dof_ids]
    np.testing.assert_allclose(torque, _slope(_potential_energy, np.array(q)), atol=1e-6)
    misplaced = (*COM[:3], np.add(COM[3], 0.001), *COM[4:])  # the comparison must notice 1 mm
    wrong = _slope(lambda x: _potential_energy(x, misplaced), np.array(q))
    assert np.abs(torque - wrong).max() > 1e-3


@pose
def test_mass_matrix_is_that_of_the_seven_links(arm, q):
    data, matrix = _at(arm, q), np.zeros((7, 7))
    mujoco.mj_fullM(arm.model, data, matrix)
    np.testing.assert_allclose(matrix - np.diag(arm.model.dof_armature), _mass_matrix(q), atol=1e-7)


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
    assert arm.model.body_mass.sum() == pytest.approx(0.629769 + sum(MASS), abs=1e-12)


@pytest.mark.parametrize("controller", shipped("controllers"))
def test_every_shipped_controller_moves_it_and_keeps_the_limits(controller):
    wall = ("trocar.wall={}",) if controller == "rcm_interaction_force" else ()  # it feels for one
    trace = simulate(load_scenario("circle_panda", controller=controller, assignments=(*SHORT, *wall)))
    assert trace.meta.ending.outcome.name == "COMPLETED"
    assert trace["tip_error_m"].max() < 1.5e-3
    assert trace["rcm_error_m"].max() < 5e-3
