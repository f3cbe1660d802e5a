"""Start configuration and reach: can the instrument get there through the trocar, and from which joints?

Solved with mink: the tip's position is a task, the shaft through the trocar a hard constraint, joint
limits are limits, and a weak posture task picks one of the redundant solutions.
"""

import mink
import numpy as np
from numpy.typing import NDArray

from surgsim.control.mink_tasks import RcmTask
from surgsim.control.rcm import rcm_kinematics
from surgsim.errors import UnreachableError
from surgsim.models.arm import ArmModel
from surgsim.models.config import InstrumentConfig, TrocarConfig
from surgsim.spatial import unit
from surgsim.tasks.base import Task

Array = NDArray[np.float64]

TIP_TOLERANCE_M = 1e-6
RCM_TOLERANCE_M = 1e-6
MAX_INCLINATION_RAD = np.deg2rad(80.0)
_LIMIT_MARGIN_RAD = 0.01


class Reach:
    """Inverse kinematics of the nominal arm with the shaft in the trocar.

    Args:
        arm: The nominal arm.
        p_WC: Trocar position (3,) [m], or None without one.
    """

    def __init__(self, arm: ArmModel, p_WC: Array | None) -> None:
        self._arm = arm
        self._p_WC = p_WC
        scene = arm.scene
        self._configuration = mink.Configuration(scene.model)
        self._tip = mink.FrameTask("tip", "site", position_cost=1.0, orientation_cost=0.0)
        self._posture = mink.PostureTask(scene.model, cost=1e-4)
        self._limits = [
            mink.ConfigurationLimit(scene.model, gain=0.95, min_distance_from_limits=_LIMIT_MARGIN_RAD)
        ]
        self._rows: list[RcmTask] = []
        if p_WC is not None:
            self._rows.append(RcmTask(scene.tip_site, scene.model.nv))
            self._rows[0].target = p_WC

    def solve(self, p_WT: Array, q: Array, posture: Array, iterations: int) -> Array:
        """Joint positions (n,) [rad] near `q` whose tip is at `p_WT` (3,) [m], by repeated mink steps.

        The hard rows are dropped in a step in which they cannot be met inside the joint limits, so the
        result must be checked with `miss`.
        """
        inside = self._arm.limits.q_min + _LIMIT_MARGIN_RAD, self._arm.limits.q_max - _LIMIT_MARGIN_RAD
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
            if count >= 1 and max(self.miss(configuration.q, p_WT)) < 1e-9:
                break
        return np.asarray(np.clip(np.array(configuration.q), *inside))

    def _step(self, configuration: mink.Configuration, *, hard: bool) -> Array:
        tasks = [self._tip, self._posture] + ([] if hard else self._rows)
        rows = self._rows if hard and self._rows else None
        step: Array = mink.solve_ik(
            configuration, tasks, 1.0, "daqp", damping=1e-9, limits=self._limits, constraints=rows
        )
        return step

    def miss(self, q: Array, p_WT: Array) -> tuple[float, float]:
        """Distance of tip from `p_WT` and of shaft from trocar at `q` [m]."""
        kin = self._arm.kinematics(q)
        rcm = 0.0
        if self._p_WC is not None:
            rcm = float(np.linalg.norm(rcm_kinematics(kin, self._p_WC, np.zeros(3)).error))
        return float(np.linalg.norm(kin.p_WT - p_WT)), rcm

    def near_limit(self, q: Array) -> str:
        """Which joints of `q` are at their position limit, in words."""
        limits = self._arm.limits
        margin = np.minimum(q - limits.q_min, limits.q_max - q)
        at = [f"joint {i + 1}" for i in np.flatnonzero(margin < 2 * _LIMIT_MARGIN_RAD)]
        return f"{' and '.join(at)} at the position limit" if at else "no joint at its limit, out of reach"


def solve_start(reach: Reach, arm: ArmModel, p_WT: Array, posture: Array) -> Array:
    """Start configuration (n,) [rad]: tip at `p_WT`, shaft through the trocar, near `posture`.

    Tries the posture and then turned copies of it.

    Raises:
        UnreachableError: If none leads to a solution inside the joint limits.
    """
    best, best_miss = posture, np.inf
    for turn in (0.0, 0.5, -0.5, 1.0, -1.0, 1.5, -1.5):
        guess = posture.copy()
        guess[0] += turn
        q = reach.solve(p_WT, guess, posture, 200)
        tip, rcm = reach.miss(q, p_WT)
        if TIP_TOLERANCE_M <= tip < 1e-4:  # the posture's pull is left
            q = reach.solve(p_WT, q, q, 50)
            tip, rcm = reach.miss(q, p_WT)
        if tip < TIP_TOLERANCE_M and rcm < RCM_TOLERANCE_M:
            return q
        if tip + rcm < best_miss:
            best, best_miss = q, tip + rcm
    tip, rcm = reach.miss(best, p_WT)
    raise UnreachableError(
        f"the start at {_point(p_WT)} cannot be reached: the best configuration found leaves the tip "
        f"{1e3 * tip:.1f} mm and the shaft {1e3 * rcm:.1f} mm away ({reach.near_limit(best)})"
    )


def check_path(
    reach: Reach,
    task: Task,
    q_start: Array,
    instrument: InstrumentConfig | None,
    trocar: TrocarConfig | None,
    *,
    entering: bool = False,
) -> None:
    """Refuse a path that the instrument cannot follow through the trocar.

    `entering` allows the tip to be on the port's axis outside the patient.

    Raises:
        UnreachableError: With the time, the place and the reason.
    """
    q = q_start
    for where, p in task.reach():
        if trocar is not None:
            check_through_port(p, where, instrument, trocar, entering)
        q = reach.solve(p, q, q, 10)
        tip, rcm = reach.miss(q, p)
        if tip > 1e-4 or rcm > 1e-4:
            raise UnreachableError(
                f"{where} {_point(p)} cannot be reached: the tip stays {1e3 * tip:.1f} mm "
                f"and the shaft {1e3 * rcm:.1f} mm away ({reach.near_limit(q)})"
            )


def check_through_port(
    p: Array, what: str, instrument: InstrumentConfig | None, trocar: TrocarConfig, entering: bool = False
) -> None:
    """Refuse a tip position `p` (3,) [m] that is no pose of the instrument through the port.

    `entering` allows one on the port's axis outside the patient.

    Raises:
        UnreachableError: With `what` and the reason.
    """
    if entering and _above_port(p, trocar):
        return
    reason = None if instrument is None else _outside_port(p, instrument, trocar)
    if reason:
        raise UnreachableError(f"{what} {_point(p)} cannot be reached: {reason}")


def _above_port(p: Array, trocar: TrocarConfig) -> bool:
    r, axis = p - np.array(trocar.position_m), unit(np.array(trocar.axis))
    height = float(r @ axis)
    return height >= 0.0 and float(np.linalg.norm(r - height * axis)) < 1e-3


def _outside_port(p: Array, instrument: InstrumentConfig, trocar: TrocarConfig) -> str | None:
    """Why a tip at `p` (3,) [m] is no pose through the port, or None."""
    r = p - np.array(trocar.position_m)
    depth = float(np.linalg.norm(r))
    axis = unit(np.array(trocar.axis))
    if depth > instrument.shaft_length_m:
        return f"it is {depth:.3f} m from the trocar, but the shaft is {instrument.shaft_length_m:.3f} m long"
    if depth == 0.0 or r @ axis >= 0.0:
        return f"it is outside the patient, {r @ axis:.3f} m above the port"
    inclination = float(np.arccos(np.clip(-(r @ axis) / depth, -1.0, 1.0)))
    if inclination > MAX_INCLINATION_RAD:
        return (
            f"the shaft would be inclined {np.rad2deg(inclination):.0f} deg to the port's axis, more than "
            f"{np.rad2deg(MAX_INCLINATION_RAD):.0f} deg"
        )
    return None


def _point(p: Array) -> str:
    return "(" + ", ".join(f"{x:.3f}" for x in p) + ") m"
