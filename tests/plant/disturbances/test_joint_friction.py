"""Joint friction: a joint sticks below the dry friction torque and moves above it."""

import mujoco
import numpy as np
import pytest

from surgsim.plant.disturbances.joint_friction import JointFrictionConfig

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
        plant._qvel[:] = 0.5
        mujoco.mj_step1(plant._scene.model, plant._data)
        state = plant._state()
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
