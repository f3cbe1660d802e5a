"""An arm from somebody's file moves as the file says, under the package's names."""

import mujoco
import numpy as np
import pytest
from foreign_arms import NAMES, urdf_text, write_stl
from pydantic import ValidationError

from surgsim.models.adopted.arm import adopted
from surgsim.models.build import Scene, build_arm
from surgsim.models.config import RobotConfig, SceneConfig
from surgsim.models.folders import robot_file, robot_names


def _scene(**robot) -> Scene:
    return build_arm(SceneConfig(robot=RobotConfig(**robot), instrument=None))


def _theirs(path, base: str, flange: str, held: dict[str, float]):
    """Flange, inertia and bias of the file itself, seen from the base, without the hand."""
    spec = mujoco.MjSpec.from_file(str(path))
    spec.delete(spec.body("hand"))
    for mesh in [mesh for mesh in spec.meshes if mesh.name == "lost"]:
        for geom in [geom for geom in spec.geoms if geom.meshname == "lost"]:
            spec.delete(geom)
        spec.delete(mesh)
    for key in list(spec.keys):
        spec.delete(key)
    for name in ("rail", "pan"):
        spec.delete(spec.joint(name))
    model = spec.compile()
    model.opt.gravity[:] = 0.0, 0.0, -9.81
    data = mujoco.MjData(model)

    def evaluate(q, v):
        joints = [model.joint(name) for name in held]
        for joint, position, speed in zip(joints, q, v, strict=True):
            data.qpos[joint.qposadr], data.qvel[joint.dofadr] = position, speed
        mujoco.mj_forward(model, data)
        R = data.body(base).xmat.reshape(3, 3)
        place = R.T @ (data.site(flange).xpos - data.body(base).xpos)
        M = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, M)
        dofs = [int(joint.dofadr[0]) for joint in joints]
        return place, R.T @ data.site(flange).xmat.reshape(3, 3), M[np.ix_(dofs, dofs)], data.qfrc_bias[dofs]

    return evaluate


def test_kinematics_and_dynamics_are_those_of_the_file(mjcf):
    scene = _scene(mjcf=str(mjcf), base_body="pedestal", joints=NAMES)
    evaluate = _theirs(mjcf, "pedestal", "attachment_site", dict.fromkeys(NAMES, 0.0))
    model, data = scene.model, mujoco.MjData(scene.model)
    rng = np.random.default_rng(0)
    for _ in range(50):
        q, v = rng.uniform(scene.limits.q_min, scene.limits.q_max), rng.normal(size=7)
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_forward(model, data)
        place, axes, M, bias = evaluate(q, v)
        mine = np.zeros((7, 7))
        mujoco.mj_fullM(model, data, mine)
        np.testing.assert_allclose(data.site_xpos[scene.flange_site], place, atol=1e-13)
        np.testing.assert_allclose(data.site_xmat[scene.flange_site].reshape(3, 3), axes, atol=1e-13)
        np.testing.assert_allclose(mine, M, atol=1e-12)
        np.testing.assert_allclose(data.qfrc_bias, bias, atol=1e-11)


@pytest.mark.parametrize("name", robot_names())
def test_a_shipped_arm_read_as_a_file_is_the_same_arm(name):
    named, read = _scene(name=name), _scene(mjcf=str(robot_file(name)))
    rng = np.random.default_rng(1)
    for field in ("q_min", "q_max", "velocity", "acceleration", "torque", "jerk", "torque_rate"):
        np.testing.assert_array_equal(getattr(named.limits, field), getattr(read.limits, field))
    np.testing.assert_array_equal(named.shapes.ends, read.shapes.ends)
    assert named.shapes.names == read.shapes.names
    for _ in range(20):
        q, v = rng.uniform(named.limits.q_min, named.limits.q_max), rng.normal(size=7)
        places, biases = [], []
        for scene in (named, read):
            data = mujoco.MjData(scene.model)
            data.qpos[:], data.qvel[:] = q, v
            mujoco.mj_forward(scene.model, data)
            places.append(data.site_xpos[scene.tip_site].copy())
            biases.append(data.qfrc_bias.copy())
        np.testing.assert_allclose(*places, atol=1e-13)
        np.testing.assert_allclose(*biases, atol=1e-11)


def test_limits_come_from_servos_motors_and_ranges(mjcf):
    scene = _scene(mjcf=str(mjcf), base_body="pedestal", joints=NAMES)
    np.testing.assert_array_equal(scene.limits.torque, [150, 150, 100, 80, 70, 40, 30])
    np.testing.assert_allclose(scene.limits.q_max[:3], np.deg2rad([170, 120, 170]))
    assert scene.limits.q_max[6] == pytest.approx(2 * np.pi, abs=1e-4)  # no range: a turn either way
    np.testing.assert_allclose(scene.home, [0.0, 0.4, 0.0, 1.0, 0.0, 0.5, 0.0])
    given = _scene(
        mjcf=str(mjcf),
        base_body="pedestal",
        joints=NAMES,
        limits={"torque_nm": (9.0,) * 7, "velocity_rad_per_s": (1.5,) * 7},
        home_rad=(0.1,) * 7,
    )
    np.testing.assert_array_equal(scene.model.dof_armature, 0.05)
    heavy = _scene(mjcf=str(mjcf), base_body="pedestal", joints=NAMES, armature_kg_m2=(0.2,) * 6 + (0.1,))
    np.testing.assert_array_equal(heavy.model.dof_armature, [0.2] * 6 + [0.1])
    assert set(given.limits.torque) == {9.0}
    assert set(given.limits.velocity) == {1.5}
    assert set(given.home) == {0.1}


def test_the_card_says_what_was_assumed_and_left_out(mjcf):
    card = adopted(RobotConfig(mjcf=str(mjcf), base_body="pedestal", joints=NAMES)).card
    assert card.joints == NAMES
    assert card.links == tuple(f"l{i}" for i in range(1, 8))
    assert card.mass_kg == pytest.approx(3 + 0.7 + 3 + 2.5 + 2.5 + 1.6 + 1.6 + 0.3 + 0.1)
    assert card.rolls_shaft
    assert card.redundancy == 1
    assert any("'A6'" in line for line in card.assumed)  # its range
    assert any("velocity limit of every joint" in line for line in card.assumed)
    left_out = " ".join(card.left_out)
    for word in ("hand 'hand'", "'pan'", "not_there.stl", "servos"):
        assert word in left_out


def test_a_urdf_keeps_its_limits_and_finds_its_package(urdf):
    scene = _scene(urdf=str(urdf))
    np.testing.assert_allclose(scene.limits.velocity, [1.1, 1.2, 1.3, 1.4, 1.5, 1.6])
    np.testing.assert_allclose(scene.limits.torque, [130, 110, 90, 70, 50, 30])
    assert scene.limits.q_max[0] == pytest.approx(2 * np.pi, abs=1e-4)
    np.testing.assert_array_equal(scene.limits.q_max[1:], 2.5)
    np.testing.assert_allclose(scene.model.dof_damping, 0.2)
    card = adopted(RobotConfig(urdf=str(urdf))).card
    assert card.redundancy == 0
    assert ["base.dae" in line for line in card.left_out] == [True]
    drawn = adopted(RobotConfig(urdf=str(urdf))).spec(drawn=True)
    assert {geom.parent.name for geom in drawn.geoms} == {"base", *(f"link{i}" for i in range(1, 7))}


def test_the_kinematics_of_a_urdf_are_those_of_its_text(urdf):
    """Products of the text's own transforms, by hand."""
    scene = _scene(urdf=str(urdf))
    data = mujoco.MjData(scene.model)
    q = np.array([0.3, -0.4, 0.5, 0.6, -0.7, 0.8])
    data.qpos[:] = q
    mujoco.mj_kinematics(scene.model, data)

    def turn(axis, angle):
        a, b = [i for i in range(3) if i != axis]
        T = np.eye(4)
        T[[a, a, b, b], [a, b, a, b]] = np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)
        if axis == 1:
            T[:3, :3] = T[:3, :3].T
        return T

    def moved(z):
        T = np.eye(4)
        T[2, 3] = z
        return T

    T = moved(0.1)
    for i in range(1, 7):
        T = T @ moved(0.15) @ turn(0, 0.0 if i == 1 else np.pi / 2 * (-1) ** i) @ turn(2, q[i - 1])
    T = T @ moved(0.08) @ turn(2, 0.3)
    np.testing.assert_allclose(data.site_xpos[scene.flange_site], T[:3, 3], atol=1e-12)
    np.testing.assert_allclose(data.site_xmat[scene.flange_site].reshape(3, 3), T[:3, :3], atol=1e-12)


@pytest.mark.parametrize("joints", [6, 7, 8])
def test_arms_of_six_to_eight_joints(tmp_path, joints):
    path = tmp_path / "arm.urdf"
    path.write_text(urdf_text(joints))
    assert _scene(urdf=str(path)).model.nv == joints


def _refused(**robot) -> str:
    with pytest.raises(ValidationError) as caught:
        RobotConfig(**robot)
    return caught.value.errors()[0]["msg"]


def test_what_is_no_arm_is_refused_naming_it(mjcf, urdf, tmp_path):
    path = str(mjcf)
    assert "joint 'rail' is a slide joint" in _refused(mjcf=path)
    assert "6 to 8 joints" in _refused(mjcf=path, joints=NAMES[:5])
    assert "'A9'" in _refused(mjcf=path, joints=("A9", *NAMES[1:]))
    assert "from the base on: 'A1', 'A2'" in _refused(mjcf=path, joints=("A2", "A1", *NAMES[2:]))
    assert "no site 'grip'. Sites: 'attachment_site'" in _refused(mjcf=path, flange={"site": "grip"})
    assert "'nobody'" in _refused(mjcf=path, base_body="nobody")
    assert "not on the way" in _refused(mjcf=path, base_body="table")
    assert "no joint moves the flange" in _refused(mjcf=path, flange={"body": "table"})
    assert "is not between base and flange" in _refused(mjcf=path, joints=("pan", *NAMES[1:]))
    short = {"torque_nm": (1.0,) * 6}
    assert "6 numbers; the arm has 7" in _refused(mjcf=path, base_body="pedestal", joints=NAMES, limits=short)
    few = (0.1,) * 6
    keys = {"mjcf": path, "base_body": "pedestal", "joints": NAMES}
    assert "armature_kg_m2 has 6 numbers" in _refused(**keys, armature_kg_m2=few)
    far = (0.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert "joint 2 at 3 rad" in _refused(mjcf=path, base_body="pedestal", joints=NAMES, home_rad=far)
    assert "is no URDF" in _refused(urdf=path)
    assert "is no MJCF" in _refused(mjcf=str(urdf))
    assert "cannot be read" in _refused(mjcf=str(tmp_path / "no.xml"))
    assert "one of name, mjcf and urdf" in _refused(name="lwr4plus", mjcf=path)
    assert "one of name, mjcf and urdf" in _refused()
    assert "for an arm from a file" in _refused(name="lwr4plus", base_body="x")
    assert "A file is given as mjcf or urdf" in _refused(name="arm.xml")


def _changed(path, old: str, new: str) -> str:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    return str(path)


def test_a_joint_without_torque_limit_is_refused(mjcf):
    path = _changed(mjcf, '<motor joint="A5" ctrlrange="-40 40"/>', "")
    assert "no torque limit of joint 'A5'" in _refused(mjcf=path, base_body="pedestal", joints=NAMES)


def test_springs_couplings_and_two_joints_in_a_body_are_refused(mjcf):
    original = mjcf.read_text()
    spring = _changed(mjcf, '<joint name="A2"', '<joint stiffness="5" name="A2"')
    assert "'A2' has a spring" in _refused(mjcf=spring, base_body="pedestal", joints=NAMES)
    mjcf.write_text(original)
    equality = '<equality><joint joint1="A2" joint2="A3"/></equality><actuator>'
    coupled = _changed(mjcf, "<actuator>", equality)
    assert "'A2' is coupled" in _refused(mjcf=coupled, base_body="pedestal", joints=NAMES)
    mjcf.write_text(original)
    second = '<joint name="A4" axis="0 0 1" range="-170 170"/><joint name="B" axis="1 0 0" range="-9 9"/>'
    both = _changed(mjcf, '<joint name="A4" axis="0 0 1" range="-170 170"/>', second)
    keyless = _changed(mjcf, '0.5 0 0"/></keyframe>', '0.5 0 0 0"/></keyframe>')
    assert both == keyless
    joints = (*NAMES[:5], "B", *NAMES[5:])
    assert "'A4' and 'B' both move body 'l5'" in _refused(mjcf=both, base_body="pedestal", joints=joints)


def test_xacro_is_refused_with_the_way_out(tmp_path):
    path = tmp_path / "arm.urdf.xacro"
    path.write_text('<robot name="a" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:include/></robot>')
    assert "xacro arm.urdf.xacro > arm.urdf" in _refused(urdf=str(path))


def test_the_hash_covers_every_file_and_is_checked(mjcf):
    keys = {"mjcf": str(mjcf), "base_body": "pedestal", "joints": NAMES}
    before = RobotConfig(**keys).files_sha256
    assert RobotConfig(**keys, files_sha256=before).files_sha256 == before
    write_stl(mjcf.parent / "meshes" / "shell.stl", up=0.2)
    after = RobotConfig(**keys).files_sha256
    assert after != before
    assert "has changed" in _refused(**keys, files_sha256=before)


def test_capsules_may_be_listed_by_the_files_bodies(mjcf):
    capsules = ({"body": "plate", "from_m": (0.0, 0.0, 0.0), "to_m": (0.1, 0.0, 0.0), "radius_m": 0.02},)
    scene = _scene(mjcf=str(mjcf), base_body="pedestal", joints=NAMES, collision=capsules)
    assert scene.shapes.names == ("link7",)
    half = np.sqrt(0.5)
    expected = [[0.0, 0.0, 0.06], [0.1 * half, 0.1 * half, 0.06]]
    np.testing.assert_allclose(scene.shapes.ends[0], expected, atol=1e-12)
    wrong = ({**capsules[0], "body": "table"},)
    assert "'table' is no body of the arm" in _refused(
        mjcf=str(mjcf), base_body="pedestal", joints=NAMES, collision=wrong
    )


THEIRS = {"base_body": "pedestal", "joints": NAMES}


def test_every_kind_of_shape_is_seen_and_held_by_its_capsule(mjcf):
    """Capsules and spheres of the file come out as the capsules that they are."""
    arm = adopted(RobotConfig(mjcf=str(mjcf), **THEIRS))
    assert all(arm.surfaces[name] for name in ("base", *(f"link{i}" for i in range(1, 8))))
    assert not any("capsule of" in line for line in arm.card.lacking)
    shapes = _scene(mjcf=str(mjcf), **THEIRS).shapes
    lengths = np.linalg.norm(shapes.ends[:, 1] - shapes.ends[:, 0], axis=1)
    found = {name: (r, length) for name, r, length in zip(shapes.names, shapes.radii, lengths, strict=True)}
    for name, radius, length in (("link1", 0.06, 0.2), ("link4", 0.06, 0.19), ("link6", 0.055, 0.0)):
        assert found[name][0] == pytest.approx(radius, rel=0.06)
        assert found[name][1] == pytest.approx(length, abs=0.012)


def test_an_attached_model_is_part_of_the_hash_and_of_the_arm(mjcf, tmp_path):
    part = (
        '<mujoco><worldbody><body name="cam"><geom type="sphere" size=".03" mass="{}"/></body>'
        "</worldbody></mujoco>"
    )
    (tmp_path / "cam.xml").write_text(part.format(1.0))
    _changed(mjcf, "<asset>", '<asset><model name="cam" file="cam.xml"/>')
    site = '<site name="attachment_site"'
    path = _changed(mjcf, site, f'<attach model="cam" body="cam" prefix="c"/>{site}')
    before = RobotConfig(mjcf=path, **THEIRS)
    (tmp_path / "cam.xml").write_text(part.format(3.0))
    after = RobotConfig(mjcf=path, **THEIRS)
    assert before.files_sha256 != after.files_sha256
    assert adopted(after).card.mass_kg - adopted(before).card.mass_kg == pytest.approx(2.0)


def test_a_lost_mesh_takes_no_mass_with_it(mjcf):
    cover = '<body name="cover"><geom type="mesh" mesh="lost" mass="0.8"/></body><body name="hand"'
    path = _changed(mjcf, '<body name="hand"', cover)
    assert "mass of body 'cover' comes from its geom" in _refused(mjcf=path, **THEIRS)


def test_a_root_that_moves_is_welded_and_kept(mjcf):
    """The rail is the root here, and the arm's own joints are named."""
    card = adopted(RobotConfig(mjcf=str(mjcf), joints=NAMES)).card
    assert any("'rail'" in line for line in card.left_out)
    scene = _scene(mjcf=str(mjcf), joints=NAMES)
    data = mujoco.MjData(scene.model)
    mujoco.mj_kinematics(scene.model, data)
    assert data.body("link1").xpos[2] == pytest.approx(0.15)  # from the rail's frame
    assert scene.model.body("base").mass[0] > 4.0


def test_what_the_form_has_no_place_for_is_refused(mjcf, tmp_path):
    curved = _changed(mjcf, '<joint name="A2"', '<joint damping="1 0.5" name="A2"')
    assert "'A2' has damping that is not linear" in _refused(mjcf=curved, **THEIRS)
    path = tmp_path / "arm.urdf"
    path.write_text(urdf_text().replace('velocity="1.2"', 'velocity="fast"'))
    assert "joint 'joint_2': velocity=\"fast\" is no limit" in _refused(urdf=str(path))


def test_inertia_on_the_edge_of_what_is_possible_is_kept(mjcf):
    edge = '<inertial pos="0 .1 .02" euler="10 20 30" mass="3" diaginertia=".01 .013 .023"/>'
    path = _changed(mjcf, '<inertial pos="0 .1 .02" mass="3" fullinertia=".02 .01 .02 .001 0 .002"/>', edge)
    moments = np.sort(_scene(mjcf=path, **THEIRS).model.body("link2").inertia)
    np.testing.assert_allclose(moments, [0.01, 0.013, 0.023], rtol=1e-12)


def test_a_motor_in_the_parent_frame_of_a_hinge_is_a_motor(mjcf):
    motor = '<motor jointinparent="A5" ctrlrange="-33 44"/>'
    path = _changed(mjcf, '<motor joint="A5" ctrlrange="-40 40"/>', motor)
    assert _scene(mjcf=path, **THEIRS).limits.torque[5] == 33.0
