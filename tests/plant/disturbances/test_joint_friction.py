"""Joint friction: a joint sticks below the dry friction torque and moves above it."""

import mujoco
import numpy as np
import pytest

from surgsim.errors import ScenarioError
from surgsim.plant.disturbances.joint_friction import JointFriction, JointFrictionConfig

COULOMB = 0.5
CREEP_RAD_PER_S = 0.005  # MuJoCo's friction is a soft constraint
joints = pytest.mark.parametrize("joint", range(7))


def _motion(arm, disturbed, q, joint, torque, ticks, config):
    """States under gravity compensation by the nominal model and `torque` on one joint."""
    plant = disturbed.plant_of(config)
    states = [plant.reset(q)]
    for _ in range(ticks):
        bias = arm.dynamics(states[-1].q, states[-1].v).bias
        states.append(plant.step(bias + torque * np.eye(7)[joint], np.zeros(7)))
    return states


@pytest.fixture
def q(random_q):
    return random_q(np.random.default_rng(1))


@joints
@pytest.mark.parametrize("sign", [1, -1])
def test_below_the_dry_friction_a_joint_sticks_and_above_it_moves(arm, disturbed, q, joint, sign):
    def end(share, coulomb=COULOMB):
        config = JointFrictionConfig(coulomb_nm=coulomb)
        return _motion(arm, disturbed, q, joint, sign * share * COULOMB, 200, config)[-1]

    stuck, moved, free = end(0.8), end(2.0), end(0.8, coulomb=0.0)
    assert sign * stuck.v[joint] < CREEP_RAD_PER_S
    assert sign * moved.v[joint] > 5.0 * CREEP_RAD_PER_S
    assert sign * free.v[joint] > 5.0 * CREEP_RAD_PER_S


def test_a_moving_joint_loses_the_dry_friction_torque(arm, disturbed, q):
    """In steady sliding, friction is worth its torque: momentum falls by it."""

    def slow_down(coulomb):
        plant = disturbed.plant_of(JointFrictionConfig(coulomb_nm=coulomb))
        plant.reset(q)
        state = plant.set_velocity(np.full(7, 0.5))
        v0, M = state.v, arm.dynamics(q, state.v).mass_matrix
        for _ in range(5):
            state = plant.step(arm.dynamics(state.q, state.v).bias + arm.damping * state.v, np.zeros(7))
        return M @ (v0 - state.v) / (5 * disturbed.DT)

    lost = slow_down(COULOMB) - slow_down(0.0)
    np.testing.assert_allclose(lost, COULOMB, rtol=0.02)


def test_viscous_friction_adds_to_the_model_s_own_damping(arm, disturbed):
    scene, _ = disturbed.scene_of(JointFrictionConfig(coulomb_nm=0.3, viscous_nm_s_per_rad=1.5))
    np.testing.assert_allclose(scene.model.dof_damping, arm.damping + 1.5)
    np.testing.assert_allclose(scene.model.dof_frictionloss, 0.3)


def test_each_joint_s_friction_is_drawn_within_the_spread_from_the_seed(arm, disturbed):
    def friction(seed):
        config = JointFrictionConfig(coulomb_nm=1.0, viscous_nm_s_per_rad=2.0, spread=0.5)
        scene, _ = disturbed.scene_of(config, seed=seed)
        return scene.model.dof_frictionloss.copy(), scene.model.dof_damping - arm.damping

    drawn = np.array([friction(seed)[0] for seed in range(10)])
    assert drawn.min() >= 0.5
    assert drawn.max() <= 1.5
    assert np.unique(drawn).size == 70
    np.testing.assert_array_equal(friction(3)[0], drawn[3])
    dry, viscous = friction(3)
    np.testing.assert_allclose(viscous, 2.0 * dry)


STATIC, STRIBECK = 0.8, 0.05


def _stribeck(**keys):
    return JointFrictionConfig(
        coulomb_nm=COULOMB, static_nm=STATIC, stribeck_velocity_rad_per_s=STRIBECK, **keys
    )


def test_without_a_static_torque_it_is_coulomb_friction_and_nothing_runs_in_a_step():
    assert type(JointFrictionConfig().build(np.random.default_rng(0))) is JointFriction
    assert JointFriction.push is JointFriction.__mro__[2].push


@joints
def test_it_breaks_away_at_the_static_torque_not_at_coulomb_s(arm, disturbed, q, joint):
    def end(share, config):
        return _motion(arm, disturbed, q, joint, share * STATIC, 200, config)[-1].v[joint]

    between = (COULOMB + STATIC) / (2 * STATIC)
    assert end(between, _stribeck()) < CREEP_RAD_PER_S
    assert end(between, JointFrictionConfig(coulomb_nm=COULOMB)) > CREEP_RAD_PER_S
    assert end(1.5, _stribeck()) > 5.0 * CREEP_RAD_PER_S


def _sliding(disturbed, q, config, speed):
    """Joint velocities one step after `speed`."""
    plant = disturbed.plant_of(config)
    plant.reset(q)
    plant.set_velocity(speed)
    plant.step(np.zeros(7), np.zeros(7))
    return plant._data.qvel.copy()


@pytest.mark.parametrize("speed", [0.03, 0.05, 0.1, 0.3])
def test_in_motion_it_falls_from_static_to_coulomb_friction_with_speed(arm, disturbed, q, speed):
    """Momentum lost to friction in one step, beside that of Coulomb friction alone."""
    M = arm.dynamics(q, np.zeros(7)).mass_matrix + disturbed.DT * np.diag(arm.damping)
    speed = speed * np.array([1, -1, 1, 1, -1, 1, -1])
    dry, wet = (
        _sliding(disturbed, q, config, speed)
        for config in (JointFrictionConfig(coulomb_nm=COULOMB), _stribeck())
    )
    surplus = (STATIC - COULOMB) * np.exp(-((speed / STRIBECK) ** 2))
    np.testing.assert_allclose(M @ (dry - wet) / disturbed.DT, np.sign(speed) * surplus, atol=0.02 * STATIC)


def test_friction_takes_energy_out(arm, disturbed, q):
    """Its force times the velocity after the step, over a motion that sticks, slips and turns.

    A sticking joint creeps, on a soft constraint: what that puts in is below a millionth of what sliding
    takes out.
    """
    plant = disturbed.plant_of(_stribeck())
    state = plant.reset(q)
    data, power, slips, sticks = plant._data, [], 0, 0
    for k in range(1500):
        drive = 1.2 * np.sin(2.0 * np.pi * 2.0 * k * disturbed.DT + np.arange(7))
        mujoco.mj_step1(plant._scene.model, data)
        for part in plant.parts:
            part.push(k * disturbed.DT, plant._scene, data)
        data.ctrl[:] = arm.dynamics(state.q, state.v).bias + drive
        bound = data.efc_frictionloss.copy()
        assert len(bound) == 7
        mujoco.mj_step2(plant._scene.model, data)
        force, v = data.efc_force.copy(), data.qvel.copy()
        assert (np.abs(force) <= bound + 1e-9).all()
        power.append(force * v)
        slips += (np.abs(v) > 0.01).sum()
        sticks += (np.abs(v) < 1e-4).sum()
        state = plant.see()
    power = np.array(power)
    assert slips > 1000
    assert sticks > 1000
    assert power[power > 0.0].sum() < 1e-6 * -power.sum()


def test_several_add_up(disturbed, q):
    once = disturbed.plant_of(JointFrictionConfig(coulomb_nm=1.0, static_nm=1.6))
    twice = disturbed.plant_of(*[JointFrictionConfig(coulomb_nm=0.5, static_nm=0.8)] * 2)
    once.reset(q), twice.reset(q)
    for k in range(100):
        a, b = (plant.step(np.full(7, 3.0 * np.sin(0.05 * k)), np.zeros(7)) for plant in (once, twice))
    np.testing.assert_allclose(a.q, b.q, atol=1e-12)
    assert np.abs(a.q - q).max() > 1e-3


@pytest.mark.parametrize(("coulomb", "static"), [(0.5, 0.4), (0.0, 0.4)])
def test_a_static_torque_below_coulomb_s_or_without_it_is_refused(scenario, coulomb, static):
    with pytest.raises(ScenarioError, match=f"static_nm {static:g} must be at least coulomb_nm {coulomb:g}"):
        scenario(f"disturbances=[{{type: joint_friction, coulomb_nm: {coulomb}, static_nm: {static}}}]")
