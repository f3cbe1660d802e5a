"""The velocity-level problem that every resolver is given at a tick, and what it answers."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from surgsim.compiled import compiled
from surgsim.control.rcm import Rcm
from surgsim.errors import Outcome
from surgsim.models.arm import Kinematics
from surgsim.models.build import JointLimits
from surgsim.tasks.base import TipCommand

Array = NDArray[np.float64]
NO_VALUES = np.zeros(0)
NO_VALUES.flags.writeable = False


class ControlFailure(Exception):
    """The controller cannot give a command: the run ends with this outcome.

    Attributes:
        outcome: How the run ends.
        detail: What the controller saw, for the person who looks into it.
        data: Arrays that let the failure be examined, e.g. the infeasible QP.
    """

    def __init__(self, outcome: Outcome, detail: str, data: Mapping[str, Array] | None = None) -> None:
        self.outcome = outcome
        self.detail = detail
        self.data = dict(data or {})
        super().__init__(detail)


@dataclass(frozen=True, slots=True, kw_only=True)
class VelocityProblem:
    """Move the tip as commanded, keep the shaft in the trocar, stay inside the bounds.

    Attributes:
        t_s: Time since the controller started [s].
        dt_s: Control period [s].
        q: Joint positions at which the kinematics were evaluated (7,) [rad].
        v: Joint velocities there (7,) [rad/s].
        kin: Kinematics at `q`.
        command: Desired tip motion.
        rcm: RCM error and Jacobian, or None without a trocar.
        p_WC: Trocar position (3,) [m]; NaN without one.
        v_WC: Trocar velocity (3,) [m/s]; zeros without one.
        lower: Lower velocity bounds Omega (7,) [rad/s].
        upper: Upper velocity bounds Omega (7,) [rad/s].
        limits: The arm's joint limits.
        position_gain_per_s: alpha of Omega [1/s].
    """

    t_s: float
    dt_s: float
    q: Array
    v: Array
    kin: Kinematics
    command: TipCommand
    rcm: Rcm | None
    p_WC: Array
    v_WC: Array
    lower: Array
    upper: Array
    limits: JointLimits
    position_gain_per_s: float

    @property
    def tip_error(self) -> Array:
        """p_WT - p_WTd (3,) [m]."""
        return self.kin.p_WT - self.command.p_WTd


@dataclass(frozen=True, slots=True, kw_only=True)
class Resolution:
    """A resolver's answer.

    Attributes:
        qdot: Joint velocities inside the bounds (7,) [rad/s].
        residual: Norm of the task and RCM rows that `qdot` leaves unmet [m/s].
        command: The tip motion that `qdot` follows, where that is not the task's, for the torque law.
        values: Values of the resolver's own columns (k,).
    """

    qdot: Array
    residual: float
    command: TipCommand | None = None
    values: Array = field(default_factory=lambda: NO_VALUES)


def velocity_bounds(q: Array, limits: JointLimits, position_gain_per_s: float) -> tuple[Array, Array]:
    """Omega of the VPRNN paper: velocity limits, tightened as a joint nears its position limit.

    max(-v_max, -alpha (q - q_min)) <= q' <= min(v_max, alpha (q_max - q))

    A joint already past its limit gets the bound that drives it back, capped by its velocity limit.

    Returns:
        Lower and upper bounds, each (7,) [rad/s].
    """
    return _velocity_bounds(q, limits.q_min, limits.q_max, limits.velocity, position_gain_per_s)


@compiled
def _velocity_bounds(
    q: Array, q_min: Array, q_max: Array, velocity: Array, gain: float
) -> tuple[Array, Array]:
    lower = np.maximum(-velocity, gain * (q_min - q))
    upper = np.minimum(velocity, gain * (q_max - q))
    return np.minimum(lower, velocity), np.maximum(upper, -velocity)


BRAKING_SHARE = 0.5


def braking_bounds(problem: VelocityProblem, last: Array) -> tuple[Array, Array]:
    """Omega with acceleration limits: reachable from `last` (7,) [rad/s], and able to stop in time.

    |q' - last| <= a_max T, and the speed towards a position limit is one from which half of a_max
    can stop in time: the task rows couple the joints, so that another joint may have to brake harder.
    Where these exclude each other, Omega and the room to stop hold before the acceleration limit.

    Returns:
        Lower and upper bounds, each (7,) [rad/s].
    """
    limits = problem.limits
    return _braking_bounds(
        problem.lower,
        problem.upper,
        problem.q,
        last,
        limits.q_min,
        limits.q_max,
        limits.acceleration,
        BRAKING_SHARE * limits.acceleration,
        problem.position_gain_per_s,
        problem.dt_s,
    )


@compiled
def stopping_speed(room: float, a: float, gain: float, dt: float) -> float:
    """Speed from which `a` suffices to stay below gain * room, Omega's bound, until standstill.

    The parabola of constant deceleration meets the line gain * room with equal slope at the speed a / gain.
    One period's travel is taken off the room first.
    """
    if room <= a / gain**2:
        return gain * max(room, 0.0)
    reach = a * dt
    return float(np.sqrt(reach * reach + 2.0 * a * (room - 0.5 * a / gain**2)) - reach)


@compiled
def _braking_bounds(
    lower: Array,
    upper: Array,
    q: Array,
    last: Array,
    q_min: Array,
    q_max: Array,
    a: Array,
    a_stop: Array,
    gain: float,
    dt: float,
) -> tuple[Array, Array]:
    low, high = np.empty(7), np.empty(7)
    for i in range(7):
        reach = a[i] * dt
        high[i] = min(upper[i], max(stopping_speed(q_max[i] - q[i], a_stop[i], gain, dt), lower[i]))
        low[i] = max(lower[i], min(-stopping_speed(q[i] - q_min[i], a_stop[i], gain, dt), upper[i]))
        fastest, slowest = last[i] + reach, last[i] - reach
        high[i] = min(high[i], fastest) if fastest >= low[i] else low[i]
        low[i] = max(low[i], slowest) if slowest <= high[i] else high[i]
    return low, high


def stacked_rows(
    problem: VelocityProblem, k_tip: float, k_rcm: float, *, rcm: bool = True
) -> tuple[Array, Array]:
    """Rows [J_T; J_rcm] (5, 7) and right side [v_d; v_rcm] (5,), eq. (20) of the VPRNN paper.

    v_d = -k1 (p - p_d) + p_d', v_rcm = -k2 e + N C'. Without a trocar, or with `rcm` False, the three tip
    rows alone.
    """
    v_d = problem.command.v_WTd - k_tip * problem.tip_error
    shaft = problem.rcm
    if shaft is None or not rcm:
        return problem.kin.Jv_WT, v_d
    v_rcm = shaft.trocar_velocity - k_rcm * shaft.error
    return np.concatenate((problem.kin.Jv_WT, shaft.jacobian)), np.concatenate((v_d, v_rcm))


def bounded_resolution(problem: VelocityProblem, qdot: Array, J: Array, rhs: Array) -> Resolution:
    """`qdot` projected on the bounds, with the residual that this leaves in `J qdot = rhs`."""
    inside, residual = _bounded(qdot, problem.lower, problem.upper, J, rhs)
    return Resolution(qdot=inside, residual=residual)


@compiled
def _bounded(qdot: Array, lower: Array, upper: Array, J: Array, rhs: Array) -> tuple[Array, float]:
    inside = np.minimum(np.maximum(qdot, lower), upper)
    total = 0.0
    for i in range(J.shape[0]):
        row = -rhs[i]
        for j in range(7):
            row += J[i, j] * inside[j]
        total += row * row
    return inside, np.sqrt(total)
