"""What every instrument estimator promises."""

from typing import Any

import numpy as np

from surgsim.array import Array
from surgsim.contract.arms import arm_of, on_every_arm
from surgsim.contract.check import Check, require
from surgsim.contract.problems import DT, velocity_problem
from surgsim.control.instrument_estimators.base import InstrumentProblem
from surgsim.models.arm import ArmModel
from surgsim.models.config import SceneConfig
from surgsim.plant.state import NOT_TRACKED, TrackedPose

_OFF_M = 1e-3


def _corrections(estimator: Any, arm: ArmModel, *, tracked: bool) -> Array:
    """Twists (40, 2, 3) while the arm moves and its instrument is seen a millimetre off, or not at all."""
    p = velocity_problem(arm, 0, trocar_speed=0.0)
    memory, rows = None, []
    for k in range(40):
        q, pose = p.q + 1e-3 * k * DT * p.v, NOT_TRACKED
        if tracked:
            kin = arm.kinematics(q)
            p_WT = kin.p_WT + _OFF_M * kin.R_WT[:, 0]
            pose = TrackedPose(samples=1 + k // 10, age_s=k % 10 * DT, p_WT=p_WT, R_WT=kin.R_WT)
        problem = InstrumentProblem(t_s=k * DT, dt_s=DT, q=q, v=p.v, tracked=pose)
        if k == 0:
            memory = estimator.start(problem)
        found, memory = estimator.step(problem, memory)
        rows.append([found.linear, found.angular])
    return np.array(rows)


@on_every_arm
def leaves_the_unseen(config: Any, scene: SceneConfig) -> None:
    """Nothing is corrected where no tracker has measured anything."""
    arm = arm_of(scene)
    found = _corrections(config().build(arm), arm, tracked=False)
    require(not found.any(), f"a correction of {np.abs(found).max():.3g} without a tracked instrument")


@on_every_arm
def corrects_a_little(config: Any, scene: SceneConfig) -> None:
    """Corrections are finite, no larger than the error that is seen, and the same again."""
    arm = arm_of(scene)
    estimator = config().build(arm)
    found = _corrections(estimator, arm, tracked=True)
    require(np.isfinite(found).all(), "a correction is not finite")
    most = np.linalg.norm(found[:, 0], axis=1).max()
    require(most <= 1.5 * _OFF_M, f"a correction of {most:.3g} m where the instrument is {_OFF_M:g} m off")
    again = _corrections(estimator, arm, tracked=True)
    require(np.array_equal(again, found), "the same again gives other corrections")


CHECKS = (
    Check(name="corrects nothing without a tracker", run=leaves_the_unseen),
    Check(name="corrects no more than is seen, is finite and repeats itself", run=corrects_a_little),
)
