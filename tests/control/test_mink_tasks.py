"""What mink is given by us, against the RCM's own kinematics and mink's own limits."""

import pickle

import mink
import numpy as np
import pytest

from surgsim.contract.arms import arm_of, scenes
from surgsim.contract.problems import DT, random_q
from surgsim.control.mink_tasks import LimitRows, RcmTask
from surgsim.models.robot import joint_names


def test_rcm_task_has_the_error_and_jacobian_of_the_rcm_rows(arm, velocity_problem):
    model = arm.scene.model
    task = RcmTask(arm.scene.tip_site, model.nv)
    for seed in range(3):
        p = velocity_problem(seed)
        configuration = mink.Configuration(model, q=p.q)
        task.target = p.p_WC
        np.testing.assert_allclose(task.compute_error(configuration), p.rcm.error, atol=1e-14)
        np.testing.assert_allclose(task.compute_jacobian(configuration), p.rcm.jacobian, atol=1e-14)


def test_a_copy_of_the_task_looks_at_the_configuration_that_it_is_given(arm, velocity_problem):
    model, p = arm.scene.model, velocity_problem(0)
    task = RcmTask(arm.scene.tip_site, model.nv)
    task.target = p.p_WC
    task.compute_error(mink.Configuration(model, q=p.q + 0.1))
    copy = pickle.loads(pickle.dumps(task))
    configuration = mink.Configuration(model, q=p.q)
    np.testing.assert_allclose(copy.compute_error(configuration), p.rcm.error, atol=1e-14)
    np.testing.assert_allclose(copy.compute_jacobian(configuration), p.rcm.jacobian, atol=1e-14)


@pytest.mark.parametrize("scene", scenes(), ids=lambda scene: scene.robot.name)
def test_limit_rows_are_those_of_mink_s_two_limits_bit_for_bit(scene):
    arm, random = arm_of(scene), np.random.default_rng(0)
    model, q = arm.scene.model, np.zeros(arm.limits.q_min.size)
    speeds = dict(zip(joint_names(model), arm.limits.velocity.tolist(), strict=True))
    rows, configuration = LimitRows(model, speeds, 0.01, DT, q), mink.Configuration(model)
    theirs = (mink.VelocityLimit(model, speeds), mink.ConfigurationLimit(model, gain=0.01))
    for _ in range(5):
        q[:] = random_q(arm, random)
        configuration.update(q)
        wanted = [limit.compute_qp_inequalities(configuration, DT) for limit in theirs]
        found = rows.compute_qp_inequalities(configuration, DT)
        np.testing.assert_array_equal(found.G, np.vstack([row.G for row in wanted]))
        np.testing.assert_array_equal(found.h, np.hstack([row.h for row in wanted]))
