"""What every robot's folder must hold, and that every robot has the same scenarios."""

import mujoco
import numpy as np
import pytest

from surgsim.control.rcm import rcm_kinematics
from surgsim.control.self_motion import elbow_swivel_rad
from surgsim.models.arm import ArmModel
from surgsim.models.build import Scene, build, build_arm
from surgsim.models.config import RobotConfig, SceneConfig, TrocarConfig
from surgsim.models.folders import arms_for_tests, named_spec, robot_names
from surgsim.models.robot import joint_names, link_names, motor_names, robot_joints
from surgsim.scenario.load import load_scenario, of_one_arm, shipped

every_robot = pytest.mark.parametrize("name", robot_names())
every_arm = pytest.mark.parametrize("name", [*robot_names(), *arms_for_tests()])


def _arm(name: str) -> Scene:
    return build_arm(SceneConfig(robot=RobotConfig(name=name), instrument=None))


def _joints(name: str) -> int:
    return robot_joints(RobotConfig(name=name))


def test_the_arms_and_their_joints():
    ours = {name: _joints(name) for name in robot_names()}
    assert ours == {"fr3": 7, "iiwa14": 7, "lwr4plus": 7, "panda": 7}
    tested = {name: _joints(name) for name in arms_for_tests()}
    assert tested == {"test_arm_6": 6, "test_arm_7": 7, "test_arm_8": 8}


@every_arm
def test_names_follow_the_rules(name):
    spec, n = named_spec(name, drawn=True), _joints(name)
    joints = [f"joint{i}" for i in range(1, n + 1)]
    assert spec.modelname == name
    assert [body.name for body in spec.bodies[1:]] == ["base", *(f"link{i}" for i in range(1, n + 1))]
    assert [joint.name for joint in spec.joints] == list(joint_names(spec)) == joints
    motors = [(motor.name, motor.target) for motor in spec.actuators]
    assert motors == list(zip(motor_names(n), joints, strict=True))
    assert [site.name for site in spec.sites] == ["flange"]
    assert spec.site("flange").parent.name == link_names(n)[-1] == f"link{n}"
    assert not spec.keys  # a home in mid range needs none, and grafting would rename it


@every_robot
def test_the_last_joint_turns_about_the_tool_axis(name):
    arm = _arm(name)
    data = mujoco.MjData(arm.model)
    data.qpos[arm.qpos_ids] = 0.4 * arm.limits.q_min + 0.6 * arm.limits.q_max
    mujoco.mj_forward(arm.model, data)
    z = data.site_xmat[arm.flange_site].reshape(3, 3)[:, 2]
    np.testing.assert_allclose(data.xaxis[arm.dof_ids[6]], z, atol=1e-12)
    offset = data.site_xpos[arm.flange_site] - data.xanchor[arm.dof_ids[6]]
    np.testing.assert_allclose(np.cross(offset, z), 0, atol=1e-12)
    assert offset @ z > 0.05


def test_what_is_left_when_tip_and_shaft_are_held():
    """The null space of [J_T; J_rcm] without the roll about the shaft, where the last joint is one."""
    rolls = {name: 1 for name in (*robot_names(), *arms_for_tests())} | {"test_arm_8": 0}
    for name, roll in rolls.items():
        arm = ArmModel(SceneConfig(robot=RobotConfig(name=name)))
        q = 0.3 * arm.limits.q_min + 0.7 * arm.limits.q_max
        kin = arm.kinematics(q)
        rcm = rcm_kinematics(kin, kin.p_WT - 0.2 * kin.R_WT[:, 2], np.zeros(3))
        rows = {False: kin.Jv_WT, True: np.vstack([kin.Jv_WT, rcm.jacobian])}
        for trocar, J in rows.items():
            assert arm.redundancy(trocar) == q.size - np.linalg.matrix_rank(J, tol=1e-6) - roll
        turned = arm.kinematics(q + 0.1 * np.eye(q.size)[-1])
        moved = np.abs(turned.p_WT - kin.p_WT).max() + np.abs(turned.R_WT[:, 2] - kin.R_WT[:, 2]).max()
        assert (moved < 1e-12) == arm.rolls_shaft == bool(roll)


@every_arm
def test_limits_are_whole_and_the_motors_are_torques(name):
    arm = _arm(name)
    limits, model = arm.limits, arm.model
    assert (limits.q_min < limits.q_max).all()
    for limit in (limits.velocity, limits.acceleration, limits.torque):
        assert np.isfinite(limit).all()
        assert (limit > 0).all()
    for limit in (limits.jerk, limits.torque_rate):
        assert limit.shape == (_joints(name),)
        assert (limit > 0).all()
    np.testing.assert_array_equal(model.actuator_ctrlrange[:, 0], -limits.torque)
    np.testing.assert_array_equal(model.actuator_gear[:, 0], 1)
    np.testing.assert_array_equal(model.actuator_gainprm[:, 0], 1)
    np.testing.assert_array_equal(model.actuator_biasprm, 0)
    assert model.jnt_limited.all()
    assert model.actuator_ctrllimited.all()


@every_arm
def test_every_link_is_physically_consistent(name):
    model = _arm(name).model
    for body in ("base", *link_names(_joints(name))):
        index = model.body(body).id
        moments = model.body_inertia[index]
        # The pseudo-inertia is positive definite exactly when the mass is positive and so is each half sum
        # of two principal moments less the third.
        assert model.body_mass[index] > 0, body
        assert (moments.sum() / 2 - moments > 0).all(), body


@every_arm
def test_the_motors_can_hold_arm_and_instrument_anywhere(name):
    arm = ArmModel(SceneConfig(robot=RobotConfig(name=name)))
    rng = np.random.default_rng(0)
    for _ in range(200):
        q = rng.uniform(arm.limits.q_min, arm.limits.q_max)
        assert (np.abs(arm.dynamics(q, np.zeros_like(q)).bias) < arm.limits.torque).all()


@every_robot
def test_the_drawing_has_no_mass_and_touches_nothing(name):
    config = SceneConfig(robot=RobotConfig(name=name), trocar=TrocarConfig(position_m=(0.1, 0.5, 0.2)))
    drawn, bare = build(config).model, build(config, drawn=False).model
    assert drawn.ngeom > bare.ngeom == 0
    assert not drawn.geom_contype.any()
    assert drawn.body_mass.sum() == bare.body_mass.sum()


def test_a_limit_that_no_one_publishes_is_infinite():
    limits = _arm("lwr4plus").limits
    assert np.isinf(limits.jerk).all()
    assert np.isinf(limits.torque_rate).all()


def _from_the_port(part, port):
    """`part` of a scenario with the places of goals, walls and tissue taken from the port on."""
    if isinstance(part, list):
        return [_from_the_port(one, port) for one in part]
    if not isinstance(part, dict):
        return part
    return {
        key: np.round(np.array(value) - port, 9).tolist()
        if key in ("position_m", "point_m", "start_m") and value is not None
        else _from_the_port(value, port)
        for key, value in part.items()
    }


@pytest.mark.parametrize("name", [name for name in of_one_arm(shipped()) if name.endswith("_lwr4plus")])
def test_every_lwr4plus_scenario_has_a_twin_on_the_panda(name):
    """The same but for the robot, its start and the place of the port; all else lies the same to the port."""
    original = load_scenario(name).resolved()
    twin = load_scenario(name.replace("lwr4plus", "panda")).resolved()
    assert (original["robot"]["name"], twin["robot"]["name"]) == ("lwr4plus", "panda")
    for scenario in (original, twin):
        port = np.array(scenario["trocar"].pop("position_m"))
        for key in ("name", "description", "robot", "start"):
            del scenario[key]
        scenario["task"].pop("board", None)
        for key in ("task", "props", "disturbances"):
            scenario[key] = _from_the_port(scenario[key], port)
    assert original == twin


@every_robot
def test_the_elbow_swivels_about_the_line_from_shoulder_to_wrist(name):
    """Axes 1 to 3 meet in the shoulder, 5 and 6 in the wrist; joint 3 swivels the elbow, joint 1 does not."""
    arm = ArmModel(SceneConfig(robot=RobotConfig(name=name)))
    q = np.array(load_scenario(f"circle_{name}").start.posture_rad)
    q[1] += 0.3  # else the Panda's joints 1 and 3 are in line
    kin = arm.kinematics(q)
    for point, lines in ((1, (0, 2)), (5, (4,))):
        for line in lines:
            offset = kin.anchors_W[point] - kin.anchors_W[line]
            np.testing.assert_allclose(np.cross(offset, kin.z_W[line]), 0, atol=1e-12)
    assert elbow_swivel_rad(kin) == pytest.approx(0, abs=1e-9)  # the arm's plane is upright, the elbow on top
    assert elbow_swivel_rad(arm.kinematics(q + 0.5 * np.eye(7)[0])) == pytest.approx(0, abs=1e-9)
    one, other = (elbow_swivel_rad(arm.kinematics(q + turn * np.eye(7)[2])) for turn in (0.3, -0.3))
    assert one == pytest.approx(-other)
    assert abs(one) > 0.05
