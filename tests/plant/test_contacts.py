"""Forbidden contacts: distances against brute force, shapes against the drawing, and what is found where."""

import mujoco
import numpy as np
import pytest

from surgsim.models.build import build
from surgsim.models.collision import abdomen_semi_axes
from surgsim.models.config import RobotConfig, SceneConfig, TrocarConfig
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


@pytest.mark.parametrize("robot", ["lwr4plus", "panda"])
def test_what_is_not_looked_at_again_touches_nothing(robot):
    """Along motions of arm and port the kernel with a memory says what a look at everything says."""
    scenario = load_scenario(f"circle_{robot}", assignments=("plant={type: kinematic}",))
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
