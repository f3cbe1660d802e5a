"""What every port estimator promises."""

from dataclasses import replace
from typing import Any

import numpy as np

from surgsim.array import Array
from surgsim.contract.arms import arm_of, on_every_arm
from surgsim.contract.check import Check, require
from surgsim.contract.problems import DT, velocity_problem
from surgsim.control.port_estimators.base import PortProblem
from surgsim.models.config import SceneConfig


def _estimates(estimator: Any, problem: PortProblem) -> Array:
    """Position, velocity and acceleration (20, 3, 3) while the trocar is seen to move 10 mm/s."""
    memory, rows = estimator.start(problem), []
    for k in range(20):
        seen = replace(problem, t_s=k * DT, p_WC=problem.p_WC + 1e-5 * k)
        estimate, memory = estimator.step(seen, memory)
        rows.append([estimate.p_WC, estimate.v_WC, estimate.a_WC])
    return np.array(rows)


@on_every_arm
def starts_as_seen(config: Any, scene: SceneConfig) -> None:
    """Estimates are finite, begin where the trocar is seen, and are the same again."""
    arm = arm_of(scene)
    p = velocity_problem(arm, 0, trocar_speed=0.0)
    kin, dyn = arm.evaluate(p.q, p.v)
    problem = PortProblem(
        t_s=0.0, dt_s=DT, q=p.q, v=p.v, tau_measured=dyn.bias, kin=kin, dyn=dyn, p_WC=p.p_WC, v_WC=p.v_WC
    )
    estimator = config().build(arm)
    first = _estimates(estimator, problem)
    require(np.isfinite(first).all(), "an estimate is not finite")
    apart = np.abs(first[0, 0] - problem.p_WC).max()
    require(apart <= 1e-12, f"the first estimate is {apart:.3g} m from where the trocar is seen")
    require(np.array_equal(_estimates(estimator, problem), first), "the same again gives other estimates")


CHECKS = (Check(name="starts where the trocar is seen, is finite and repeats itself", run=starts_as_seen),)
