"""Push: the torque J^T F of the point where it acts, for its time, with smooth edges."""

import mujoco
import numpy as np
import pytest

from surgsim.plant.disturbances.push import PushConfig, push_level

FORCE = np.array([3.0, -2.0, 4.0])
POINTS = {"tip": 7, "shaft": 7, "elbow": 4, "wrist": 6}  # how many joints move it
seeds = pytest.mark.parametrize("seed", range(3))


def _joint_torque(push, t_s):
    """What the push adds to the smooth joint forces."""
    model, data = push.scene.model, push.data
    data.xfrc_applied[:] = 0.0
    mujoco.mj_forward(model, data)
    without = data.qfrc_smooth.copy()
    push.push(t_s)
    mujoco.mj_forward(model, data)
    return data.qfrc_smooth - without


@seeds
@pytest.mark.parametrize("at", POINTS)
def test_it_is_the_transposed_jacobian_times_the_force(arm, disturbed, random_q, seed, at):
    q = random_q(np.random.default_rng(seed))
    config = PushConfig(force_n=tuple(FORCE), at=at, distance_m=0.15, start_s=1.0, duration_s=1.0)
    push = disturbed.started(config, scene=disturbed.scene_of(config)[0], q=q)
    kin = arm.kinematics(q)
    shaft = kin.p_WT - 0.15 * kin.R_WT[:, 2]
    point = {"tip": kin.p_WT, "shaft": shaft, "elbow": kin.anchors_W[3], "wrist": kin.anchors_W[5]}[at]
    J = np.cross(kin.z_W, point - kin.anchors_W).T
    J[:, POINTS[at] :] = 0.0
    np.testing.assert_allclose(_joint_torque(push, 1.5), J.T @ FORCE, atol=1e-9)
    np.testing.assert_array_equal(_joint_torque(push, 0.5), 0.0)
    half = _joint_torque(push, 1.0 + 0.025)
    np.testing.assert_allclose(half, 0.5 * J.T @ FORCE, atol=1e-9)


def test_its_edges_are_smooth_and_outside_it_is_zero():
    push = PushConfig(start_s=2.0, duration_s=1.0, rise_s=0.2).build(np.random.default_rng(0))
    t = np.arange(1.5, 3.5, 1e-4)
    level = np.array([push_level(push.gains, x) for x in t])
    outside = (t <= 2.0) | (t >= 3.0)
    np.testing.assert_array_equal(level[outside], 0.0)
    np.testing.assert_allclose(level[(t >= 2.2) & (t <= 2.8)], 1.0, atol=1e-12)
    assert (level >= 0.0).all()
    assert (level <= 1.0).all()
    np.testing.assert_allclose(level, np.interp(5.0 - t, t, level), atol=1e-3)  # the same either way
    slope, curve = np.gradient(level, t), np.gradient(np.gradient(level, t), t)
    assert np.abs(slope).max() == pytest.approx(0.5 * np.pi / 0.2, rel=1e-3)
    assert np.abs(np.diff(slope)).max() < 0.02  # no kink: the slope has no step
    assert np.abs(curve).max() == pytest.approx(0.5 * (np.pi / 0.2) ** 2, rel=0.02)


def test_a_push_shorter_than_its_edges_does_not_reach_its_force():
    push = PushConfig(start_s=0.0, duration_s=0.1, rise_s=0.1).build(np.random.default_rng(0))
    assert max(push_level(push.gains, t) for t in np.linspace(0.0, 0.1, 101)) == pytest.approx(0.5)


@pytest.mark.parametrize("at", POINTS)
def test_the_plant_feels_it_for_its_time(disturbed, random_q, at):
    q = random_q(np.random.default_rng(0))
    still, pushed = (
        disturbed.plant_of(PushConfig(force_n=force, at=at, start_s=0.02, duration_s=0.05, rise_s=0.01))
        for force in ((0.0, 0.0, 0.0), tuple(FORCE))
    )
    still.reset(q), pushed.reset(q)
    gap = []
    for _ in range(60):
        a, b = (plant.step(np.zeros(7), np.zeros(7)) for plant in (still, pushed))
        gap.append(np.abs(a.v - b.v).max())
    assert max(gap[:20]) == 0.0
    assert gap[-1] > 1e-3


def test_two_pushes_add_up(disturbed, random_q):
    q = random_q(np.random.default_rng(0))
    configs = [
        PushConfig(force_n=(1.0, 0.0, 0.0), start_s=0.0),
        PushConfig(force_n=(0.0, 2.0, 0.0), start_s=0.0),
    ]

    def speed(*chosen):
        plant = disturbed.plant_of(*chosen)
        plant.reset(q)
        for _ in range(100):
            state = plant.step(np.zeros(7), np.zeros(7))
        return state.v

    nothing = speed()
    one, two, both = (speed(*chosen) - nothing for chosen in ([configs[0]], [configs[1]], configs))
    assert np.abs(one).max() > 1e-3
    np.testing.assert_allclose(both, one + two, atol=0.03 * np.abs(both).max())


def test_a_random_direction_is_drawn_from_the_seed_and_keeps_the_size(disturbed):
    def force(seed):
        config = PushConfig(force_n=(3.0, 0.0, 4.0), direction="random")
        return config.build(np.random.default_rng(seed)).gains[:3]

    drawn = np.array([force(seed) for seed in range(200)])
    np.testing.assert_allclose(np.linalg.norm(drawn, axis=1), 5.0)
    assert np.abs(drawn.mean(axis=0)).max() < 1.0  # all over the sphere
    np.testing.assert_array_equal(force(3), drawn[3])
    given = PushConfig(force_n=(3.0, 0.0, 4.0)).build(np.random.default_rng(0)).gains[:3]
    np.testing.assert_array_equal(given, [3.0, 0.0, 4.0])
