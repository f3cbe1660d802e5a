"""The nominal arm as text: what reads it has the same kinematics and dynamics."""

import mujoco
import numpy as np
import pytest

from surgsim.models.arm import ArmModel
from surgsim.models.texts import TIP, mjcf_of, urdf_of
from surgsim.scenario.load import load_scenario


@pytest.fixture(params=["circle_lwr4plus", "circle_panda", "theatre_iiwa14"])
def one(request):
    return ArmModel(load_scenario(request.param, assignments=["theatre=false"]).scene)


def states(arm):
    random = np.random.default_rng(0)
    low, high, speed = arm.limits.q_min, arm.limits.q_max, arm.limits.velocity
    for _ in range(5):
        yield random.uniform(low, high), random.uniform(-speed, speed)


def inertia_and_bias(model, q, v):
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = q, v
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    return M, data.qfrc_bias.copy(), data


def test_mujoco_makes_the_same_arm_of_the_mjcf(one):
    model = mujoco.MjModel.from_xml_string(mjcf_of(one))
    np.testing.assert_array_equal(model.dof_damping, one.damping)
    for q, v in states(one):
        M, bias, data = inertia_and_bias(model, q, v)
        kin, dyn = one.evaluate(q, v)
        np.testing.assert_allclose(data.site(TIP).xpos, kin.p_WT, atol=1e-13)
        np.testing.assert_allclose(data.site(TIP).xmat.reshape(3, 3), kin.R_WT, atol=1e-13)
        np.testing.assert_allclose(M, dyn.mass_matrix, rtol=1e-12, atol=1e-13)
        np.testing.assert_allclose(bias, dyn.bias, rtol=1e-12, atol=1e-12)


def test_the_urdf_has_the_same_tip_masses_and_gravity_but_no_armature(one):
    marked = urdf_of(one, {"there": np.array([0.1, 0.2, 0.3])})
    text = marked.replace(
        '<robot name="arm">', '<robot name="arm"><mujoco><compiler fusestatic="false"/></mujoco>'
    )
    model = mujoco.MjModel.from_xml_string(text)
    assert model.nv == one.limits.q_min.size
    np.testing.assert_allclose(model.jnt_range[:, 0], one.limits.q_min, rtol=1e-15)
    for q, v in states(one):
        M, bias, data = inertia_and_bias(model, q, v)
        kin, dyn = one.evaluate(q, v)
        np.testing.assert_allclose(data.body(TIP).xpos, kin.p_WT, atol=1e-12)
        np.testing.assert_allclose(data.body(TIP).xmat.reshape(3, 3), kin.R_WT, atol=1e-12)
        np.testing.assert_allclose(data.body("there").xpos, [0.1, 0.2, 0.3])
        np.testing.assert_allclose(M + np.diag(one.scene.model.dof_armature), dyn.mass_matrix, atol=1e-9)
        np.testing.assert_allclose(bias, dyn.bias, atol=1e-8)
