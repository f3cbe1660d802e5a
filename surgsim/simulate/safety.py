"""Ends a run within one tick of a limit being passed."""

import math

import numpy as np
from numpy.typing import NDArray

from surgsim.compiled import compiled
from surgsim.errors import Outcome
from surgsim.models.build import JointLimits
from surgsim.plant.truth import Truth
from surgsim.scenario.schema import SafetyConfig
from surgsim.spatial import shaft_distance
from surgsim.tasks.base import TipCommand
from surgsim.trace.trace import Ending

Array = NDArray[np.float64]
_POSITION_SLACK_RAD = 1e-9
_VELOCITY_SLACK = 1e-9


class SafetyMonitor:
    """Checks each tick's true state against the limits of robot and scenario.

    Args:
        config: Limits of the scenario.
        limits: Limits of the joints.
        has_trocar: Whether an RCM error is defined.
        tear_force_n: Force past which the incision tears [N]; infinite without a physical wall.
    """

    def __init__(
        self, config: SafetyConfig, limits: JointLimits, has_trocar: bool, tear_force_n: float = math.inf
    ) -> None:
        self._c = config
        self._limits = limits
        self._has_trocar = has_trocar
        self._tear = tear_force_n
        self._trocar_force = math.inf if config.trocar_force_max_n is None else config.trocar_force_max_n
        self._tip_force = math.inf if config.tip_force_max_n is None else config.tip_force_max_n

    def check(self, t_s: float, truth: Truth, command: TipCommand) -> Ending | None:
        """Why the run must end at `t_s` [s], or None."""
        rcm, tip = self._c.rcm_error_max_m, self._c.tip_error_max_m
        limits = self._limits
        safe = _is_safe(
            truth.q,
            truth.v,
            limits.q_min,
            limits.q_max,
            limits.velocity,
            self._c.stop_at_joint_limit,
            self._c.stop_at_velocity_limit,
            truth.p_WT,
            truth.p_WR,
            truth.p_WC if self._has_trocar else truth.p_WT,
            command.p_WTd,
            math.inf if rcm is None else rcm,
            math.inf if tip is None else tip,
            truth.f_C,
            min(self._tear, self._trocar_force),
            truth.f_T,
            self._tip_force,
        )
        touching = self._c.stop_at_collision and truth.contact is not None
        if safe and not touching:
            return None
        return (
            self._joint_ending(t_s, truth)
            or self._contact_ending(t_s, truth)
            or self._force_ending(t_s, truth)
            or self._error_ending(t_s, truth, command)
        )

    def _joint_ending(self, t_s: float, truth: Truth) -> Ending | None:
        limits, q, v = self._limits, truth.q, truth.v
        if not (np.isfinite(q).all() and np.isfinite(v).all()):
            return Ending(outcome=Outcome.DIVERGED, t_s=t_s, detail="joint state is not finite")
        past = np.maximum(limits.q_min - q, q - limits.q_max)
        if self._c.stop_at_joint_limit and past.max() > _POSITION_SLACK_RAD:
            i = int(np.argmax(past))
            text = (
                f"joint {i + 1} at {q[i]:.4f} rad, range [{limits.q_min[i]:.4f}, {limits.q_max[i]:.4f}] rad"
            )
            return Ending(outcome=Outcome.JOINT_LIMIT, t_s=t_s, detail=text)
        ratio = np.abs(v) / limits.velocity
        if self._c.stop_at_velocity_limit and ratio.max() > 1.0 + _VELOCITY_SLACK:
            i = int(np.argmax(ratio))
            text = f"joint {i + 1} at {v[i]:.4f} rad/s, limit {limits.velocity[i]:.4f} rad/s"
            return Ending(outcome=Outcome.VELOCITY_LIMIT, t_s=t_s, detail=text)
        return None

    def _contact_ending(self, t_s: float, truth: Truth) -> Ending | None:
        contact = truth.contact
        if contact is None or not self._c.stop_at_collision:
            return None
        outcome = Outcome.PATIENT_COLLISION if contact.with_patient else Outcome.SELF_COLLISION
        return Ending(outcome=outcome, t_s=t_s, detail=contact.detail)

    def _force_ending(self, t_s: float, truth: Truth) -> Ending | None:
        wall, tip = float(np.linalg.norm(truth.f_C)), float(np.linalg.norm(truth.f_T))
        if wall > self._tear:
            text = f"shaft presses on the wall with {wall:.2f} N, it tears at {self._tear:.2f} N"
            return Ending(outcome=Outcome.INCISION_TORN, t_s=t_s, detail=text)
        for name, force, limit in (("trocar", wall, self._trocar_force), ("tip", tip, self._tip_force)):
            if force > limit:
                text = f"{name} force {force:.2f} N, limit {limit:.2f} N"
                return Ending(outcome=Outcome.FORCE_LIMIT, t_s=t_s, detail=text)
        return None

    def _error_ending(self, t_s: float, truth: Truth, command: TipCommand) -> Ending | None:
        limit = self._c.rcm_error_max_m
        if limit is not None and self._has_trocar:
            error = shaft_distance(truth.p_WC, truth.p_WT, truth.p_WR)
            if error > limit:
                text = f"shaft {1e3 * error:.2f} mm from the trocar, limit {1e3 * limit:.2f} mm"
                return Ending(outcome=Outcome.RCM_LIMIT, t_s=t_s, detail=text)
        limit = self._c.tip_error_max_m
        if limit is not None:
            error = float(np.linalg.norm(truth.p_WT - command.p_WTd))
            if error > limit:
                text = f"tip {1e3 * error:.2f} mm from its command, limit {1e3 * limit:.2f} mm"
                return Ending(outcome=Outcome.TIP_LIMIT, t_s=t_s, detail=text)
        return None


@compiled
def _is_safe(
    q: Array,
    v: Array,
    q_min: Array,
    q_max: Array,
    v_max: Array,
    check_q: bool,
    check_v: bool,
    p_T: Array,
    p_R: Array,
    p_C: Array,
    p_Td: Array,
    rcm_max: float,
    tip_max: float,
    f_C: Array,
    f_C_max: float,
    f_T: Array,
    f_T_max: float,
) -> bool:
    """Whether no limit is passed; NaN is not safe, but a force that is NaN is not there."""
    for i in range(7):
        if not (math.isfinite(q[i]) and math.isfinite(v[i])):
            return False
        if check_q and (q[i] < q_min[i] - _POSITION_SLACK_RAD or q[i] > q_max[i] + _POSITION_SLACK_RAD):
            return False
        if check_v and abs(v[i]) > v_max[i] * (1.0 + _VELOCITY_SLACK):
            return False
    a, b, e = p_T - p_R, p_C - p_T, p_T - p_Td
    x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    rcm = math.sqrt((x * x + y * y + z * z) / (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]))
    tip = math.sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2])
    wall = math.sqrt(f_C[0] * f_C[0] + f_C[1] * f_C[1] + f_C[2] * f_C[2])
    touch = math.sqrt(f_T[0] * f_T[0] + f_T[1] * f_T[1] + f_T[2] * f_T[2])
    return rcm <= rcm_max and tip <= tip_max and not (wall > f_C_max or touch > f_T_max)
