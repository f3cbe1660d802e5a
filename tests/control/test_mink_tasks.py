import mink
import numpy as np

from surgsim.control.mink_tasks import RcmTask


def test_rcm_task_has_the_error_and_jacobian_of_the_rcm_rows(arm, velocity_problem):
    model = arm.scene.model
    task = RcmTask(arm.scene.tip_site, model.nv)
    for seed in range(3):
        p = velocity_problem(seed)
        configuration = mink.Configuration(model, q=p.q)
        task.target = p.p_WC
        np.testing.assert_allclose(task.compute_error(configuration), p.rcm.error, atol=1e-14)
        np.testing.assert_allclose(task.compute_jacobian(configuration), p.rcm.jacobian, atol=1e-14)
