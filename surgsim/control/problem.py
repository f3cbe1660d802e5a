"""The velocity-level problem that every resolver is given at a tick, and what it answers."""

from dataclasses import dataclass, field

import numpy as np

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.control.bounds import fill_braking_bounds, fill_velocity_bounds
from surgsim.control.rcm import Rcm
from surgsim.models.arm import Kinematics
from surgsim.models.build import JointLimits
from surgsim.plant.state import Wrench
from surgsim.tasks.base import TipCommand

NO_VALUES = np.zeros(0)
NO_VALUES.flags.writeable = False


@dataclass(frozen=True, slots=True, kw_only=True)
class VelocityProblem:
    """Move the tip as commanded, keep the shaft in the trocar, stay inside the bounds.

    Attributes:
        t_s: Time since the controller started [s].
        dt_s: Control period [s].
        q: Joint positions at which the kinematics were evaluated (n,) [rad].
        v: Joint velocities there (n,) [rad/s].
        kin: Kinematics at `q`.
        command: Desired tip motion.
        rcm: RCM error and Jacobian, or None without a trocar.
        p_WC: Trocar position (3,) [m]; NaN without one.
        v_WC: Trocar velocity (3,) [m/s]; zeros without one.
        lower: Lower velocity bounds Omega (n,) [rad/s].
        upper: Upper velocity bounds Omega (n,) [rad/s].
        limits: The arm's joint limits.
        position_gain_per_s: alpha of Omega [1/s].
        limit_zone_rad: How near the end of a joint's range the null space leads away from it; 0: never [rad].
        wrench: What a force-torque sensor at the flange measures; None without one.
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
    limit_zone_rad: float = 0.0
    wrench: Wrench | None = None

    @property
    def tip_error(self) -> Array:
        """p_WT - p_WTd (3,) [m]."""
        return self.kin.p_WT - self.command.p_WTd


@dataclass(frozen=True, slots=True, kw_only=True)
class Resolution:
    """A resolver's answer.

    Attributes:
        qdot: Joint velocities inside the bounds (n,) [rad/s].
        residual: Norm of the task and RCM rows that `qdot` leaves unmet [m/s].
        command: The tip motion that `qdot` follows, where that is not the task's, for the torque law.
        values: Values of the resolver's own columns (k,).
    """

    qdot: Array
    residual: float
    command: TipCommand | None = None
    values: Array = field(default_factory=lambda: NO_VALUES)


def velocity_bounds(q: Array, limits: JointLimits, position_gain_per_s: float) -> tuple[Array, Array]:
    """Omega at joint positions `q` (n,) [rad], see `surgsim.control.bounds.fill_velocity_bounds`.

    Returns:
        Lower and upper bounds, each (n,) [rad/s].
    """
    lower, upper = np.empty(q.size), np.empty(q.size)
    low, high, speed = limits.q_min, limits.q_max, limits.velocity
    fill_velocity_bounds(q, low, high, speed, position_gain_per_s, lower, upper)
    return lower, upper


def braking_bounds(problem: VelocityProblem, last: Array) -> tuple[Array, Array]:
    """Omega with acceleration limits, see `surgsim.control.bounds.fill_braking_bounds`.

    Returns:
        Lower and upper bounds, each (n,) [rad/s].
    """
    p, limits = problem, problem.limits
    low, high = np.empty(last.size), np.empty(last.size)
    fill_braking_bounds(
        p.q,
        last,
        p.lower,
        p.upper,
        limits.q_min,
        limits.q_max,
        limits.acceleration,
        p.position_gain_per_s,
        p.dt_s,
        low,
        high,
    )
    return low, high


def stacked_rows(
    problem: VelocityProblem, k_tip: float, k_rcm: float, *, rcm: bool = True
) -> tuple[Array, Array]:
    """Rows [J_T; J_rcm] (5, n) and right side [v_d; v_rcm] (5,), eq. (20) of the VPRNN paper.

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
        for j in range(J.shape[1]):
            row += J[i, j] * inside[j]
        total += row * row
    return inside, np.sqrt(total)
