"""The start near a posture, solved with mink.

The tip's position is a task, the shaft through the trocar a hard constraint, joint limits are limits, and a
weak posture task picks one of the redundant solutions.
"""

import mink
import numpy as np
from numpy.typing import NDArray

from surgsim.control.mink_tasks import RcmTask
from surgsim.simulate.reach import LIMIT_MARGIN_RAD, Reach

Array = NDArray[np.float64]

_TIP_M, _RCM_M = 1e-6, 1e-6
_TURNS_RAD = (0.0, 0.5, -0.5, 1.0, -1.0, 1.5, -1.5)


def near_posture(reach: Reach, p_WT: Array, posture: Array) -> Array | None:
    """Joint positions (n,) [rad] near `posture` with the tip at `p_WT` (3,) [m]; None if none are found.

    Tries the posture and then turned copies of it.
    """
    solver = _Solver(reach)
    for turn in _TURNS_RAD:
        guess = posture.copy()
        guess[0] += turn
        q = solver.solve(p_WT, guess, posture, 200)
        tip, rcm = reach.miss(q, p_WT)
        if _TIP_M <= tip < 1e-4:  # the posture's pull is left
            q = solver.solve(p_WT, q, q, 50)
            tip, rcm = reach.miss(q, p_WT)
        if tip < _TIP_M and rcm < _RCM_M:
            return q
    return None


class _Solver:
    """Repeated steps of mink.

    Args:
        reach: The arm and its port.
    """

    def __init__(self, reach: Reach) -> None:
        self._reach = reach
        scene = reach.arm.scene
        self._configuration = mink.Configuration(scene.model)
        self._tip = mink.FrameTask("tip", "site", position_cost=1.0, orientation_cost=0.0)
        self._posture = mink.PostureTask(scene.model, cost=1e-4)
        self._limits = [
            mink.ConfigurationLimit(scene.model, gain=0.95, min_distance_from_limits=LIMIT_MARGIN_RAD)
        ]
        self._rows: list[RcmTask] = []
        if reach.p_WC is not None:
            self._rows.append(RcmTask(scene.shaft_end_site, scene.model.nv))
            self._rows[0].target = reach.p_WC

    def solve(self, p_WT: Array, q: Array, posture: Array, iterations: int) -> Array:
        """Joint positions (n,) [rad] near `q` whose tip is at `p_WT` (3,) [m], by repeated mink steps.

        The hard rows are dropped in a step in which they cannot be met inside the joint limits, so the
        result must be checked with `Reach.miss`.
        """
        inside = (
            self._reach.arm.limits.q_min + LIMIT_MARGIN_RAD,
            self._reach.arm.limits.q_max - LIMIT_MARGIN_RAD,
        )
        configuration = self._configuration
        configuration.update(np.clip(q, *inside))
        self._tip.set_target(mink.SE3.from_translation(p_WT))
        self._posture.set_target(posture)
        for count in range(iterations):
            try:
                step = self._step(configuration, hard=True)
            except mink.NoSolutionFound:
                try:
                    step = self._step(configuration, hard=False)
                except mink.NoSolutionFound:  # too far away for the solver: what is there will miss
                    break
            length = float(np.linalg.norm(step))
            configuration.integrate_inplace(step * min(1.0, 0.3 / max(length, 1e-12)), 1.0)
            if count >= 1 and max(self._reach.miss(configuration.q, p_WT)) < 1e-9:
                break
        return np.asarray(np.clip(np.array(configuration.q), *inside))

    def _step(self, configuration: mink.Configuration, *, hard: bool) -> Array:
        tasks = [self._tip, self._posture] + ([] if hard else self._rows)
        rows = self._rows if hard and self._rows else None
        step: Array = mink.solve_ik(
            configuration, tasks, 1.0, "daqp", damping=1e-9, limits=self._limits, constraints=rows
        )
        return step
