"""The arms whose every link is published, against kinematics and dynamics that the tests write themselves."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from published_arms import GRAVITY_M_PER_S2, PUBLISHED, PublishedArm, slope

from surgsim.bench.cases import NEEDS
from surgsim.models.build import GRAVITY_M_PER_S2 as OURS
from surgsim.models.build import Scene, build_arm
from surgsim.models.config import RobotConfig, SceneConfig
from surgsim.scenario.load import load_scenario, shipped
from surgsim.simulate.loop import simulate

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
TIP_MAX_M = {"fr3": 1.5e-3, "iiwa14": 2.5e-3, "panda": 1.5e-3}
"""The iiwa's rotors reflect up to 3.4 kg m2: it follows a path of a second later."""
every_pose = pytest.mark.parametrize("q", POSES.values(), ids=POSES)


@pytest.fixture(scope="module", params=PUBLISHED)
def name(request) -> str:
    return request.param


@pytest.fixture(scope="module")
def published(name) -> PublishedArm:
    return PUBLISHED[name]


@pytest.fixture(scope="module")
def arm(name) -> Scene:
    return build_arm(SceneConfig(robot=RobotConfig(name=name), instrument=None))


def _at(arm: Scene, q) -> mujoco.MjData:
    data = mujoco.MjData(arm.model)
    data.qpos[arm.qpos_ids] = q
    mujoco.mj_forward(arm.model, data)
    return data


def _mass_matrix(arm: Scene, q) -> np.ndarray:
    data, matrix = _at(arm, q), np.zeros((7, 7))
    mujoco.mj_fullM(arm.model, data, matrix)
    return matrix - np.diag(arm.model.dof_armature)


def test_gravity_is_the_same():
    assert GRAVITY_M_PER_S2 == OURS


@every_pose
def test_every_joint_turns_about_its_axis(arm, published, q):
    data = _at(arm, q)
    for dof, frame in zip(arm.dof_ids, published.frames(q), strict=True):
        np.testing.assert_allclose(data.xaxis[dof], frame[:3, 2], atol=1e-12)
        off = data.xanchor[dof] - frame[:3, 3]
        np.testing.assert_allclose(np.cross(off, frame[:3, 2]), 0, atol=1e-12)


@every_pose
def test_the_flange_is_on_the_axis_of_the_last_link_with_its_axes(arm, published, q):
    data = _at(arm, q)
    turn = data.site_xmat[arm.flange_site].reshape(3, 3)
    np.testing.assert_allclose(data.site_xpos[arm.flange_site], published.flange(q), atol=1e-12)
    np.testing.assert_allclose(turn, published.frames(q)[-1][:3, :3], atol=1e-12)


@every_pose
def test_the_jacobian_is_the_slope_of_the_flange_s_position(arm, published, q):
    jacobian = np.zeros((3, arm.model.nv))
    mujoco.mj_jacSite(arm.model, _at(arm, q), jacobian, None, arm.flange_site)
    np.testing.assert_allclose(jacobian[:, arm.dof_ids], slope(published.flange, np.array(q)), atol=1e-9)


@every_pose
def test_gravity_torque_is_the_slope_of_the_potential_energy(arm, published, q):
    torque = _at(arm, q).qfrc_bias[arm.dof_ids]
    np.testing.assert_allclose(torque, slope(published.potential_energy, np.array(q)), atol=1e-6)
    coms = (*published.coms[:3], np.add(published.coms[3], 0.001), *published.coms[4:])
    wrong = slope(replace(published, coms=coms).potential_energy, np.array(q))
    assert np.abs(torque - wrong).max() > 1e-3  # the comparison notices 1 mm


@every_pose
def test_mass_matrix_is_that_of_the_seven_links(arm, published, q):
    matrix = _mass_matrix(arm, q)
    np.testing.assert_allclose(matrix, published.mass_matrix(q), atol=1e-7)
    tensors = (*published.tensors[:4], 1.01 * published.tensors[4], *published.tensors[5:])
    wrong = replace(published, tensors=tensors).mass_matrix(q)
    assert np.abs(matrix - wrong).max() > 1e-5  # the comparison notices 1 %
    assert np.linalg.eigvalsh(matrix).min() > 0


@pytest.mark.parametrize("controller", shipped("controllers"))
def test_every_shipped_controller_moves_it_and_keeps_the_limits(name, controller):
    wall = NEEDS.get(controller, ())
    trace = simulate(load_scenario(f"circle_{name}", controller=controller, assignments=(*SHORT, *wall)))
    assert trace.meta.ending.outcome.name == "COMPLETED"
    assert trace["tip_error_m"].max() < TIP_MAX_M[name]
    assert trace["rcm_error_m"].max() < 5e-3
