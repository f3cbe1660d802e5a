"""Forbidden contacts: distances against brute force, shapes against the drawing, and what is found where."""

import mujoco
import numpy as np
import pytest

from surgsim.models.build import SharedArm, build, build_shared
from surgsim.models.collision import abdomen_semi_axes
from surgsim.models.config import InstrumentConfig, RobotConfig, SceneConfig, TrocarConfig
from surgsim.plant.between import ArmsWatch
from surgsim.plant.contacts import ContactWatch, body_gap, is_clear, table_gap
from surgsim.scenario.load import load_scenario, of_one_arm, shipped
from surgsim.simulate.setup import prepare
from surgsim.spatial import segment_distance_squared

PORT = (0.0, 0.55, 0.2)
SCENE = SceneConfig(robot=RobotConfig(name="lwr4plus"), trocar=TrocarConfig(position_m=PORT), theatre=False)
SHARES = np.linspace(0.0, 1.0, 401)[:, None]


def _points(a, b):
    return a + SHARES * (b - a)


@pytest.mark.parametrize("seed", range(20))
def test_segment_distance(seed):
    a0, a1, b0, b1 = np.random.default_rng(seed).uniform(-1.0, 1.0, (4, 3))
    gaps = _points(a0, a1)[:, None] - _points(b0, b1)[None]
    brute = np.sqrt((gaps**2).sum(axis=2)).min()
    exact = np.sqrt(segment_distance_squared(a0, a1, b0, b1))
    assert brute - 6e-3 <= exact <= brute + 1e-12


@pytest.mark.parametrize("seed", range(20))
def test_depth_in_the_table(seed):
    rng = np.random.default_rng(seed)
    p0, p1 = rng.uniform(-0.6, 0.6, (2, 3))
    centre, half = rng.uniform(-0.1, 0.1, 3), rng.uniform(0.1, 0.2, 3)
    outside = np.maximum(np.abs(_points(p0, p1) - centre) - half, 0.0)
    brute = max(0.0, 0.15 - np.linalg.norm(outside, axis=1).min())
    assert max(0.0, -table_gap(p0, p1, 0.15, centre, half)) == pytest.approx(brute, abs=3e-3)


@pytest.mark.parametrize("seed", range(20))
def test_a_capsule_is_in_the_body_exactly_when_its_axis_is_in_the_larger_ellipsoid(seed):
    p0, p1 = np.random.default_rng(seed).uniform(-0.5, 0.5, (2, 3))
    axes = np.array([0.19, 0.3, 0.16])
    inside = ((_points(p0, p1) / (axes + 0.05)) ** 2).sum(axis=1).min() < 1.0
    assert (body_gap(p0, p1, 0.05, axes) < 0.0) == inside


def _look(q, scene=SCENE, port=PORT):
    built = build(scene, drawn=False)
    data = mujoco.MjData(built.model)
    data.qpos[built.qpos_ids] = q
    mujoco.mj_kinematics(built.model, data)
    return ContactWatch(built, data).look(np.array(port))


REACHING = np.array([1.5708, -1.9, 0.0, 0.6, 0.0, 0.0, 0.0])


def test_patient_and_table_are_there_whether_drawn_or_not_and_move_with_the_port():
    drawn = SCENE.model_copy(update={"theatre": True})
    contact = _look(REACHING)
    assert contact is not None
    assert contact.with_patient
    assert _look(REACHING, drawn) == contact
    assert _look(REACHING, port=(0.0, 3.0, 0.2)) is None
    assert _look(REACHING, SCENE.model_copy(update={"trocar": None})) is None


@pytest.mark.parametrize("robot", ["lwr4plus", "panda"])
def test_few_configurations_touch_the_arm_itself_and_its_working_posture_does_not(robot):
    posture = load_scenario(f"circle_{robot}").start.posture_rad
    scene = build(SceneConfig(robot=RobotConfig(name=robot), theatre=False), drawn=False)
    data, rng, found = mujoco.MjData(scene.model), np.random.default_rng(0), []
    watch = ContactWatch(scene, data)
    for q in [posture, *rng.uniform(scene.limits.q_min, scene.limits.q_max, (4000, 7))]:
        data.qpos[scene.qpos_ids] = q
        mujoco.mj_kinematics(scene.model, data)
        found.append(watch.look(np.full(3, np.nan)))
    touching = [contact for contact in found if contact is not None]
    assert found[0] is None
    assert 0 < len(touching) < 200
    assert not any(contact.with_patient for contact in touching)


@pytest.mark.parametrize("robot", ["lwr4plus", "panda"])
def test_capsules_are_inside_the_drawn_links_or_near(robot):
    scene = build(SceneConfig(robot=RobotConfig(name=robot), theatre=False))
    shapes, data = scene.shapes, mujoco.MjData(scene.model)
    mujoco.mj_kinematics(scene.model, data)
    for name, body, ends in zip(shapes.names, shapes.bodies, shapes.ends, strict=True):
        geoms = np.flatnonzero(scene.model.geom_bodyid == body)
        middle = data.xpos[body] + data.xmat[body].reshape(3, 3) @ ends.mean(axis=0)
        near = min(np.linalg.norm(data.geom_xpos[g] - middle) - scene.model.geom_rbound[g] for g in geoms)
        assert near < 0.0, name


def test_the_abdomen_is_the_drawn_one():
    model = build(SCENE.model_copy(update={"theatre": True})).model
    np.testing.assert_array_equal(model.geom("abdomen").size, abdomen_semi_axes())
    centre = model.body("patient").pos
    np.testing.assert_allclose(build(SCENE).shapes.patient[0] + PORT, centre, atol=1e-12)


@pytest.mark.parametrize("name", of_one_arm(shipped()))
def test_no_shipped_scenario_starts_in_a_contact(name):
    setup = prepare(load_scenario(name, assignments=["theatre=false"]))
    setup.plant.reset(setup.q_start)
    assert setup.plant.truth().contact is None


@pytest.mark.parametrize(
    ("robot", "more"), [("lwr4plus", ()), ("panda", ()), ("lwr4plus", ("instrument={name: hook_30}",))]
)
def test_what_is_not_looked_at_again_touches_nothing(robot, more):
    """Along motions of arm and port the kernel with a memory says what a look at everything says."""
    scenario = load_scenario(f"circle_{robot}", assignments=("plant={type: kinematic}", *more))
    setup, rng = prepare(scenario), np.random.default_rng(3)
    plant, limits = setup.plant, setup.scene.limits
    other, record, world = ContactWatch(setup.scene, plant.data), plant.watch.record, plant.world
    touched = looks = ticks = 0
    for walk in range(16):
        plant.reset(setup.q_start)
        speed = rng.uniform(-0.6, 0.6, len(setup.q_start)) * (walk < 12)
        port, drift = world.p_WC.copy(), rng.uniform(-1.0, 1.0, 3) * (3e-5 if walk < 12 else 1e-3)
        for tick in range(600):
            inside = (world.q > limits.q_min) & (world.q < limits.q_max)
            plant.step(np.zeros_like(speed), np.where(inside, speed, 0.0))
            port += drift
            world.p_WC[:] = port
            before = record.p_WC.copy()
            clear = is_clear(record, world)
            looks, ticks = looks + (not np.array_equal(before, record.p_WC)), ticks + 1
            assert clear == (other.look(world.p_WC) is None)
            touched += not clear
            if tick % 33 == 0:
                plant.watch.look(world.p_WC)
    assert 100 < touched < ticks - 100
    assert looks - touched < ticks / 8


def test_a_look_from_outside_between_two_postures_does_not_hide_a_contact():
    setup = prepare(load_scenario("circle_lwr4plus", assignments=("plant={type: kinematic}",)))
    plant, rng, hidden, touching = setup.plant, np.random.default_rng(1), 0, 0
    for _ in range(2000):
        q = rng.uniform(setup.scene.limits.q_min, setup.scene.limits.q_max)
        plant.reset(setup.q_start)
        is_clear(plant.watch.record, plant.world)
        plant.reset(q)
        found = plant.truth().contact
        plant.reset(np.zeros(7))
        plant.truth()
        plant.reset(q)
        touching += found is not None
        hidden += found is not None and is_clear(plant.watch.record, plant.world)
    assert touching > 20
    assert hidden == 0


HOOK = InstrumentConfig(name="hook_30")
DOWN = np.array([1.5708, -0.5236, 0.0, 1.5708, 0.0, -1.0472, 0.0])


def _placed(scene, q):
    """MuJoCo's data with the arm at `q`, and the shaft's end and the tip there (3,) [m]."""
    data = mujoco.MjData(scene.model)
    data.qpos[scene.qpos_ids] = q
    mujoco.mj_kinematics(scene.model, data)
    return data, data.site_xpos[scene.shaft_end_site], data.site_xpos[scene.tip_site]


def test_the_bent_part_s_capsule_goes_from_the_shaft_s_end_to_the_tip():
    scene = build(SCENE.model_copy(update={"instrument": HOOK}))
    shapes, (data, end, tip) = scene.shapes, _placed(scene, DOWN)
    assert shapes.names[-3:] == ("adapter", "shaft", "bent part")
    row, radius = shapes.shaft + 1, 0.5 * HOOK.shaft_diameter_m
    assert shapes.radii[row] == radius
    ends = data.xpos[shapes.bodies[row]] + shapes.ends[row] @ data.body("instrument").xmat.reshape(3, 3).T
    u = (tip - end) / np.linalg.norm(tip - end)
    np.testing.assert_allclose(ends, [end, tip - radius * u], atol=1e-12)
    straight = build(SCENE).shapes
    of_bent = {(shapes.names[i], shapes.names[j]) for i, j in shapes.pairs if row in (i, j)}
    of_shaft = {(straight.names[i], "bent part") for i, j in straight.pairs if straight.names[j] == "shaft"}
    assert of_bent == of_shaft
    assert of_bent


def test_a_bent_part_that_passes_the_skin_far_from_the_port_is_contact_with_the_patient():
    config = SCENE.model_copy(update={"instrument": HOOK})
    scene = build(config, drawn=False)
    data, end, tip = _placed(scene, DOWN)
    watch, patient = ContactWatch(scene, data), scene.shapes.patient
    top = np.array([0.0, 0.1, 0.0])  # of the skin in the patient's frame, from the abdomen's centre
    top[2] = patient[2, 2] * np.sqrt(1.0 - np.sum((top[:2] / patient[2, :2]) ** 2))
    turn = np.array([[patient[1, 0], -patient[1, 1], 0.0], [patient[1, 1], patient[1, 0], 0.0], [0, 0, 1.0]])
    port = 0.5 * (end + tip) - turn @ top - patient[0]
    far = np.linalg.norm(0.5 * (end + tip) - port)
    assert far > 0.1
    found = watch.look(port)
    assert found is not None
    assert found.detail == f"bent part passes the skin {1e3 * far:.1f} mm from the port"
    assert found.with_patient
    lifted = watch.look(port - [0.0, 0.0, 0.03])
    assert lifted is None or "skin" not in lifted.detail


@pytest.mark.parametrize(
    ("instrument", "apart_m", "touched"),
    [
        (HOOK, 0.012, "left's bent part touches right's shaft"),
        (HOOK, 0.018, None),
        (InstrumentConfig(shaft_length_m=0.39), 0.012, None),
    ],
)
def test_the_bent_part_touches_another_arm_beside_the_shaft(instrument, apart_m, touched):
    """The right shaft crosses where the left one ends, `apart_m` beside it, where the hook points."""
    hook = build(SceneConfig(robot=RobotConfig(name="lwr4plus"), instrument=HOOK, theatre=False), drawn=False)
    left = np.array([*DOWN[:6], 0.5 * np.pi])  # the hook points across the plane of both shafts
    _, end, tip = _placed(hook, left)
    aside = np.array([np.sign(tip[0] - end[0]), 0.0, 0.0])
    assert (tip - end) @ aside > 0.0074
    place = end + apart_m * aside

    right = np.array([DOWN[0], DOWN[1] + 0.35, *DOWN[2:]])

    def scenes(base):
        names = ("left", "right")
        robots = (
            RobotConfig(name="lwr4plus"),
            RobotConfig(name="lwr4plus", base_position_m=tuple(base), base_yaw_rad=np.pi),
        )
        instruments = (instrument, InstrumentConfig())
        arms = [
            SharedArm(name=name, config=SceneConfig(robot=robot, instrument=tool, theatre=False))
            for name, robot, tool in zip(names, robots, instruments, strict=True)
        ]
        built = build_shared(arms, drawn=False)
        data = mujoco.MjData(built[0].model)
        for scene, q in zip(built, (left, right), strict=True):
            data.qpos[scene.qpos_ids] = q
        mujoco.mj_kinematics(built[0].model, data)
        return list(zip(names, built, strict=True)), data, built[1]

    arms, data, of_right = scenes(np.zeros(3))
    shaft = data.site_xpos[of_right.tip_site] - data.site_xpos[of_right.shaft_entry_site]
    middle = data.site_xpos[of_right.tip_site] - 0.1 * shaft / np.linalg.norm(shaft)
    arms, data, _ = scenes(place - middle)
    found = ArmsWatch(arms, data, frozenset(("left", "right"))).look()
    assert (found is None) if touched is None else (found or "").startswith(touched), found
