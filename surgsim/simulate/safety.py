"""Ends a run within one tick of a limit being passed."""

import math
from typing import ClassVar

import numpy as np

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.errors import Outcome
from surgsim.models.build import JointLimits
from surgsim.plant.contacts import Watch, is_clear
from surgsim.plant.truth import Truth
from surgsim.scenario.schema import SafetyConfig
from surgsim.spatial import shaft_distance
from surgsim.tasks.base import TipCommand
from surgsim.tick.algebra import norm
from surgsim.tick.arrays import Command, Record, World, new
from surgsim.trace.trace import Ending

_POSITION_SLACK_RAD = 1e-9
_VELOCITY_SLACK = 1e-9


class Guard(Record):
    """The limits as a record.

    Attributes:
        position: Whether joint ranges are checked.
        velocity: Whether joint velocities are checked.
        contact: Whether forbidden contacts are checked.
        rcm_m: Largest RCM error [m].
        tip_m: Largest tip error [m].
        wall_n: Largest force on the wall [N].
        touch_n: Largest force on the tip [N].
        q_min: Joint range (n,) [rad].
        q_max: Joint range (n,) [rad].
        v_max: Joint velocity limits (n,) [rad/s].
    """

    SHAPES: ClassVar[dict[str, str]] = {"q_min": "n", "q_max": "n", "v_max": "n"}
    position: int
    velocity: int
    contact: int
    rcm_m: float
    tip_m: float
    wall_n: float
    touch_n: float
    q_min: Array
    q_max: Array
    v_max: Array


class SafetyMonitor:
    """Checks each tick's true state against the limits of robot and scenario.

    Args:
        config: Limits of the scenario.
        limits: Limits of the joints.
        has_trocar: Whether an RCM error is defined.
        tear_force_n: Force past which the incision tears [N]; infinite without a physical wall.

    Attributes:
        guard: The limits as arrays, for `is_safe`; `check` says which one was passed.
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

        self.guard = guard = new(Guard, limits.q_min.size)
        guard.position, guard.velocity = config.stop_at_joint_limit, config.stop_at_velocity_limit
        guard.contact = config.stop_at_collision
        guard.rcm_m = _or_infinite(config.rcm_error_max_m) if has_trocar else math.inf
        guard.tip_m = _or_infinite(config.tip_error_max_m)
        guard.wall_n, guard.touch_n = min(self._tear, self._trocar_force), self._tip_force
        guard.q_min[:], guard.q_max[:], guard.v_max[:] = limits.q_min, limits.q_max, limits.velocity

    def check(self, t_s: float, truth: Truth, command: TipCommand) -> Ending | None:
        """Why the run must end at `t_s` [s], or None."""
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
            error = shaft_distance(truth.p_WC, truth.p_WS, truth.p_WR)
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


def _or_infinite(limit: float | None) -> float:
    return math.inf if limit is None else limit


@compiled
def is_safe(guard: Guard, watch: Watch, world: World, command: Command) -> bool:
    """Whether `SafetyMonitor.check` would find nothing: a NaN in the joints is not safe, one elsewhere is.

    A command of NaN ends the run as the torque that follows from it does; a force of NaN is not there.
    """
    for i in range(world.q.size):
        q, v = world.q[i], world.v[i]
        if not (math.isfinite(q) and math.isfinite(v)):
            return False
        outside = q < guard.q_min[i] - _POSITION_SLACK_RAD or q > guard.q_max[i] + _POSITION_SLACK_RAD
        if guard.position and outside:
            return False
        if guard.velocity and abs(v) > guard.v_max[i] * (1.0 + _VELOCITY_SLACK):
            return False
    square = 0.0
    for i in range(3):
        square += (world.p_WT[i] - command.p_WTd[i]) * (world.p_WT[i] - command.p_WTd[i])
    if math.sqrt(square) > guard.tip_m:
        return False
    if guard.rcm_m < math.inf and shaft_distance(world.p_WC, world.p_WS, world.p_WR) > guard.rcm_m:
        return False
    if norm(world.f_C) > guard.wall_n or norm(world.f_T) > guard.touch_n:
        return False
    return not guard.contact or is_clear(watch, world)
