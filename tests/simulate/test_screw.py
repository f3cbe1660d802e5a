"""The screw from the tip to a place: against mink's, and its Jacobian against finite differences."""

import mink
import numpy as np
import pytest

from surgsim.models.arm import ArmModel
from surgsim.simulate.screw import rotation_vector, tip_error

EPSILON = 1e-6


def random_rotation(rng):
    return mink.SO3.exp(rng.uniform(-1.7, 1.7, 3))


@pytest.mark.parametrize("seed", range(20))
def test_a_rotation_vector_is_the_logarithm_of_its_rotation(seed):
    rotation = random_rotation(np.random.default_rng(seed))
    np.testing.assert_allclose(rotation_vector(rotation.as_matrix()), rotation.log(), atol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-7, 1e-4, np.pi - 1e-7])
def test_the_smallest_and_largest_turns(angle):
    axis = np.array([0.36, -0.48, 0.8])
    found = rotation_vector(mink.SO3.exp(angle * axis).as_matrix())
    np.testing.assert_allclose(found, angle * axis, atol=1e-10)


@pytest.mark.parametrize("seed", range(10))
def test_it_is_mink_s_error_and_jacobian_of_a_frame_parallel_to_the_world_s(arm, seed):
    rng = np.random.default_rng(seed)
    model, tip = arm.scene.model, mink.FrameTask("tip", "site", position_cost=1.0, orientation_cost=0.0)
    configuration = mink.Configuration(model)
    q, p = rng.uniform(-1.5, 1.5, model.nq), rng.uniform(-0.5, 0.5, 3)
    configuration.update(q)
    tip.set_target(mink.SE3.from_translation(p))
    error, jacobian = tip_error_at(arm, p, q)
    np.testing.assert_allclose(error, tip.compute_error(configuration)[:3], atol=1e-12)
    np.testing.assert_allclose(jacobian, tip.compute_jacobian(configuration)[:3], atol=1e-12)


def tip_error_at(arm: ArmModel, p, q):
    kin = arm.kinematics(q)
    return tip_error(p, kin.p_WT, kin.R_WT, kin.Jv_WT, kin.Jw_WT)


@pytest.mark.parametrize("seed", range(5))
def test_its_jacobian_is_the_derivative_and_without_the_rotation_it_is_not(arm, seed):
    rng = np.random.default_rng(seed)
    n = arm.limits.q_min.size
    q, p = rng.uniform(-1.5, 1.5, n), rng.uniform(-0.5, 0.5, 3)
    _, jacobian = tip_error_at(arm, p, q)
    steps = EPSILON * np.eye(n)
    measured = [
        (tip_error_at(arm, p, q + step)[0] - tip_error_at(arm, p, q - step)[0]) / (2 * EPSILON)
        for step in steps
    ]
    np.testing.assert_allclose(np.transpose(measured), jacobian, atol=1e-7)
    kin = arm.kinematics(q)
    _, without = tip_error(p, kin.p_WT, kin.R_WT, kin.Jv_WT, 0.0 * kin.Jw_WT)
    assert np.abs(without - jacobian).max() > 1e-2


def test_at_its_place_the_error_is_zero(arm):
    q = np.full(arm.limits.q_min.size, 0.3)
    assert np.abs(tip_error_at(arm, arm.kinematics(q).p_WT, q)[0]).max() == 0.0
