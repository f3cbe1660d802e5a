"""Calibration error: the plant's geometry against a product of transforms with the drawn errors."""

import mujoco
import numpy as np
import pytest

from surgsim.errors import Outcome
from surgsim.models.arm import ArmModel
from surgsim.models.build import build, build_arm
from surgsim.models.config import HolderConfig, InstrumentConfig, RobotConfig, SceneConfig
from surgsim.models.folders import robot_file
from surgsim.plant.disturbances.calibration_error import CalibrationErrorConfig
from surgsim.plant.disturbances.settling import settle_cannula
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import Simulation, simulate
from surgsim.simulate.setup import prepare

OFF = {key: 0.0 for key in CalibrationErrorConfig.model_fields if key != "type"}
LARGE = CalibrationErrorConfig(**{key: 0.02 for key in OFF})
"""Two centimetres and a degree of everything: a formula of first order would be found out."""
HELD = HolderConfig(position_m=(0.03, 0.0, 0.02), quaternion_wxyz=(0.9, 0.0, 0.3, 0.1))
ARMS = {
    **{name: {"robot": RobotConfig(name=name)} for name in ("lwr4plus", "panda", "fr3", "iiwa14")},
    **{f"{n} joints": {"robot": RobotConfig(name=f"test_arm_{n}")} for n in (6, 8)},
    "from a file, held": {
        "robot": RobotConfig(
            mjcf=str(robot_file("panda")), base_position_m=(0.3, -0.2, 0.1), base_yaw_rad=0.7
        ),
        "instrument": InstrumentConfig(holder=HELD),
    },
}
arms = pytest.mark.parametrize("arm", ARMS)


def scene_config(arm):
    return SceneConfig(theatre=False, **ARMS[arm])


def part_of(config, seed=3):
    return config.build(np.random.default_rng(seed))


def placed(scene, q):
    """MuJoCo's data with the arm at `q`."""
    data = mujoco.MjData(scene.model)
    data.qpos[scene.qpos_ids] = q
    mujoco.mj_kinematics(scene.model, data)
    return data


def some_q(scene, rng):
    return rng.uniform(scene.limits.q_min, scene.limits.q_max)


def homogeneous(R, p):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, p
    return T


def turn(vector):
    """Rotation matrix of a rotation vector, by Rodrigues' formula."""
    angle = np.linalg.norm(vector)
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def turn_about(point, vector):
    R = turn(vector)
    return homogeneous(R, point - R @ point)


def matrix(quat):
    w, x, y, z = quat / np.linalg.norm(quat)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def instrument_pose(nominal, q, e):
    """T_WI (4, 4), the errors `e` inserted into the nominal model's numbers."""

    def own(name):
        body = model.body(name)
        return homogeneous(matrix(body.quat), body.pos)

    model = nominal.model
    T = own("base") @ homogeneous(turn(e.base_angle), e.base_position)
    for k in range(len(q)):
        joint = model.joint(f"joint{k + 1}")
        D = homogeneous(turn(e.link_angle[k]), e.link_position[k])
        offset = turn_about(joint.pos, e.joint_offset[k] * joint.axis)
        T = T @ own(f"link{k + 1}") @ D @ offset @ turn_about(joint.pos, q[k] * joint.axis)
    entry = model.site_pos[nominal.shaft_entry_site]
    about_entry = turn_about(entry, np.array([*e.tool_angle, 0.0]))
    return T @ own("instrument") @ homogeneous(np.eye(3), e.tool_tip) @ about_entry


@arms
@pytest.mark.parametrize("kind", [*OFF, "all"])
def test_the_plant_is_the_product_of_nominal_transforms_and_errors(arm, kind):
    errors = LARGE if kind == "all" else CalibrationErrorConfig(**{**OFF, kind: 0.02})
    part, nominal = part_of(errors), build(scene_config(arm))
    scene, rng = build(scene_config(arm), [part]), np.random.default_rng(0)
    for _ in range(5):
        q = some_q(nominal, rng)
        T_WI = instrument_pose(nominal, q, part.errors(len(q)))
        data, before = placed(scene, q), placed(nominal, q)
        for site in (scene.tip_site, scene.shaft_entry_site):
            wanted = T_WI @ np.append(nominal.model.site_pos[site], 1.0)
            np.testing.assert_allclose(data.site_xpos[site], wanted[:3], atol=1e-12)
            np.testing.assert_allclose(data.site_xmat[site].reshape(3, 3), T_WI[:3, :3], atol=1e-12)
        assert not np.allclose(data.site_xpos[scene.tip_site], before.site_xpos[scene.tip_site], atol=1e-6)


@arms
def test_without_errors_the_model_s_numbers_are_the_same(arm):
    plain = build(scene_config(arm)).model
    same = build(scene_config(arm), [part_of(CalibrationErrorConfig(**OFF))]).model
    for name in ("body_pos", "body_quat", "body_ipos", "body_iquat", "site_pos", "site_quat", "jnt_pos"):
        np.testing.assert_array_equal(getattr(same, name), getattr(plain, name), err_msg=name)


@arms
def test_nothing_but_places_of_bodies_changes(arm):
    plain, built = build(scene_config(arm)), build(scene_config(arm), [part_of(LARGE)])
    for name in ("body_mass", "body_inertia", "body_ipos", "site_pos", "jnt_axis", "jnt_range", "geom_pos"):
        np.testing.assert_array_equal(getattr(built.model, name), getattr(plain.model, name), err_msg=name)
    np.testing.assert_array_equal(built.limits.q_min, plain.limits.q_min)
    moved = {
        built.model.body(i).name
        for i in range(built.model.nbody)
        if (built.model.body_pos[i] != plain.model.body_pos[i]).any()
    }
    links = {f"link{k + 1}" for k in range(len(plain.qpos_ids))}
    assert moved == {"base", "instrument"} | links


@arms
def test_offsets_move_the_tip_by_the_jacobian_to_first_order(arm):
    part = part_of(CalibrationErrorConfig(**{**OFF, "joint_offset_rad": 1e-5}))
    nominal, scene = ArmModel(scene_config(arm)), build(scene_config(arm), [part])
    rng = np.random.default_rng(1)
    for _ in range(5):
        q = some_q(scene, rng)
        kin = nominal.kinematics(q)
        shift = placed(scene, q).site_xpos[scene.tip_site] - kin.p_WT
        np.testing.assert_allclose(shift, kin.Jv_WT @ part.errors(len(q)).joint_offset, atol=3e-9)
        assert np.linalg.norm(shift) > 3e-7


def test_the_shaft_stays_straight_and_what_is_on_it_goes_with_it():
    config = SceneConfig(robot=RobotConfig(name="lwr4plus"))
    plain, built = build(config), build(config, [part_of(LARGE)])
    data = placed(built, np.full(7, 0.4))
    tip, entry = (data.site_xpos[site] for site in (built.tip_site, built.shaft_entry_site))
    axis = (tip - entry) / np.linalg.norm(tip - entry)
    assert np.linalg.norm(tip - entry) == pytest.approx(0.4, abs=1e-12)
    for site in (built.tip_site, built.shaft_entry_site):
        np.testing.assert_allclose(data.site_xmat[site].reshape(3, 3)[:, 2], axis, atol=1e-12)
    for name in ("adapter", "shaft"):
        geom = data.geom(name)
        off = geom.xpos - entry
        assert np.linalg.norm(off - (off @ axis) * axis) < 1e-12
        np.testing.assert_allclose(geom.xmat.reshape(3, 3)[:, 2], axis, atol=1e-12)
    np.testing.assert_array_equal(built.shapes.ends, plain.shapes.ends)  # in the bodies' frames
    np.testing.assert_array_equal(built.shapes.bodies, plain.shapes.bodies)


def test_an_angle_of_the_tool_leaves_the_shaft_s_entry_where_it_is():
    config = SceneConfig(robot=RobotConfig(name="lwr4plus"), theatre=False)
    part, q = part_of(CalibrationErrorConfig(**{**OFF, "tool_angle_rad": 1e-3})), np.full(7, 0.4)
    plain, built = build(config), build(config, [part])
    before, after = placed(plain, q), placed(built, q)
    entry, tip = built.shaft_entry_site, built.tip_site
    np.testing.assert_allclose(after.site_xpos[entry], before.site_xpos[entry], atol=1e-14)
    shift = np.linalg.norm(after.site_xpos[tip] - before.site_xpos[tip])
    assert shift == pytest.approx(0.4 * np.linalg.norm(part.errors(7).tool_angle), rel=1e-5)


def test_without_an_instrument_the_arm_alone_errs():
    config = SceneConfig(robot=RobotConfig(name="lwr4plus"), theatre=False, instrument=None)
    part, q = part_of(LARGE), np.full(7, 0.4)
    tool = part_of(CalibrationErrorConfig(**{**OFF, "tool_tip_m": 0.02, "tool_angle_rad": 0.02}))
    plain, alone, moved = build(config), build(config, [tool]), build(config, [part])
    places = [placed(scene, q).site_xpos[scene.tip_site] for scene in (plain, alone, moved)]
    np.testing.assert_array_equal(places[1], places[0])
    assert np.linalg.norm(places[2] - places[0]) > 1e-3


def test_draws_are_of_the_seed_and_a_kind_that_is_off_changes_no_other():
    full, again, other = (part_of(LARGE, seed).errors(7) for seed in (1, 1, 2))
    assert all(np.array_equal(getattr(full, key), getattr(again, key)) for key in vars(full))
    assert not any(np.array_equal(getattr(full, key), getattr(other, key)) for key in vars(full))
    alone = part_of(CalibrationErrorConfig(**{**OFF, "joint_offset_rad": 0.02}), 1).errors(7)
    np.testing.assert_array_equal(alone.joint_offset, full.joint_offset)
    assert not alone.link_angle.any()


@pytest.mark.parametrize("key", OFF)
def test_each_coordinate_has_the_standard_deviation(key):
    config = CalibrationErrorConfig(**{**OFF, key: 1e-3})
    name = key.removesuffix("_rad").removesuffix("_m")
    drawn = np.array([getattr(part_of(config, seed).errors(7), name).ravel() for seed in range(1500)])
    np.testing.assert_allclose(drawn.std(axis=0), 1e-3, rtol=0.09)  # five standard errors
    np.testing.assert_allclose(drawn.mean(axis=0), 0.0, atol=1.3e-4)
    correlation = np.corrcoef(drawn.T) - np.eye(drawn.shape[1])
    assert np.abs(correlation).max() < 0.13


def test_the_controller_s_arm_stays_nominal(scenario):
    """Also in the runs that come after, which share the compiled one."""
    calm = scenario()
    before = build_arm(calm.scene)
    numbers = before.model.body_pos.copy()
    setup = prepare(scenario("disturbances=[{type: calibration_error}]"))
    assert setup.arm.scene is before is build_arm(calm.scene)
    np.testing.assert_array_equal(before.model.body_pos, numbers)
    names = [f"link{i}" for i in range(1, 8)]
    wrong = np.array([setup.scene.model.body(name).pos - before.model.body(name).pos for name in names])
    assert (wrong != 0.0).all()
    for name in names:
        np.testing.assert_array_equal(prepare(calm).scene.model.body(name).pos, before.model.body(name).pos)


def test_offsets_of_half_a_milliradian_cost_what_the_jacobian_says(scenario):
    offsets = {**OFF, "joint_offset_rad": 5e-4, "type": "calibration_error"}
    items = ", ".join(f"{key}: {value}" for key, value in offsets.items())
    short = scenario(f"disturbances=[{{{items}}}]", controller="rcm_inverse_dynamics", seed=2)
    trace, arm = simulate(short), ArmModel(short.scene)
    delta = short.build_parts()[0].errors(7).joint_offset
    off = trace.block("tip") - trace.block("tip_believed")
    wanted = np.array([arm.kinematics(q).Jv_WT @ delta for q in trace.block("q")])
    np.testing.assert_allclose(off, wanted, atol=2e-6)
    rms = np.sqrt((wanted**2).sum(axis=1).mean())
    assert 1e-4 < rms < 3e-3
    assert np.sqrt((trace["tip_error_m"] ** 2).mean()) == pytest.approx(rms, rel=0.02)
    assert trace.meta.ending.outcome is Outcome.COMPLETED


@pytest.fixture
def walled():
    """A run in the theatre whose shaft starts millimetres beside the port."""
    items = ", ".join(f"{key}: {value}" for key, value in {**OFF, "tool_tip_m": 3e-3}.items())
    calibration = f"disturbances=[{{type: calibration_error, {items}}}]"
    return load_scenario(
        "theatre_ideal_lwr4plus", assignments=[calibration, "task.duration_s=0.6", "task.ramp_s=0.1"], seed=1
    )


def test_behind_a_wall_the_cannula_starts_at_rest_around_the_shaft(walled):
    setup = prepare(walled)
    trace, wall = Simulation(setup).run(), walled.trocar.wall
    force = trace.block("trocar_force")
    cannula = np.array([trace[f"cannula_{axis}_m"][0] for axis in "xyz"])
    pressed = trace["rcm_error_m"][0] - walled.scene.clearance_m
    assert pressed * wall.contact_stiffness_n_per_m > wall.tear_force_n  # if the cannula did not give way
    frame = matrix(setup.scene.model.body("port").quat)
    stiffness = np.array([wall.lateral_stiffness_n_per_m] * 2 + [wall.axial_stiffness_n_per_m])
    np.testing.assert_allclose(frame.T @ force[0], stiffness * cannula, atol=1e-6)
    in_series = 1.0 / (1.0 / wall.contact_stiffness_n_per_m + 1.0 / wall.lateral_stiffness_n_per_m)
    size = np.linalg.norm(force, axis=1)
    assert size[0] == pytest.approx(pressed * in_series, rel=0.02)
    assert size[:50].max() < size[0] + wall.seal_friction_n
    assert trace.meta.ending.outcome is Outcome.COMPLETED


def test_a_shaft_inside_the_clearance_leaves_the_cannula_alone(walled):
    plain = prepare(walled.model_copy(update={"disturbances": ()}))
    plain.plant.reset(plain.q_start)
    place, settled = plain.plant.data.qpos.copy(), mujoco.MjData(plain.scene.model)
    settled.qpos[:] = place
    settle_cannula(plain.scene, settled)
    np.testing.assert_array_equal(settled.qpos, place)


def test_a_shaft_that_is_not_through_the_cannula_leaves_it_alone(walled):
    plain = prepare(walled.model_copy(update={"disturbances": ()}))
    data = mujoco.MjData(plain.scene.model)
    data.qpos[plain.scene.qpos_ids] = plain.q_start + np.array([0.0, -0.6, 0.0, 0.0, 0.0, 0.0, 0.0])
    settle_cannula(plain.scene, data)
    np.testing.assert_array_equal(data.qpos[plain.scene.cannula_qpos_ids], 0.0)
