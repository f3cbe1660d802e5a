"""Joint accelerations inside torque, velocity and position limits, in strict priority."""

import numpy as np
from numpy.typing import NDArray

from surgsim.compiled import compiled
from surgsim.control.problem import BRAKING_SHARE, ControlFailure, stopping_speed
from surgsim.control.qp import DenseQp
from surgsim.errors import Outcome
from surgsim.models.build import JointLimits

Array = NDArray[np.float64]

_SPEED_SHARE = 0.97
_TORQUE_SHARE = 0.999
_HORIZON_TICKS = 5.0
_GAIN_PER_S = 10.0


class AccelerationLimits:
    """Accelerations (7,) from which no joint passes its velocity limit, nor fails to stop before its range.

    A velocity bound v_b is approached as q'' <= (v_b - q') / (5 T), so that a wrong inertia of the model does
    not carry a joint past it.
    """

    def __init__(self, limits: JointLimits) -> None:
        self._l = limits
        self.torque = _TORQUE_SHARE * limits.torque

    def bounds(self, q: Array, v: Array, dt_s: float) -> tuple[Array, Array]:
        """Lower and upper accelerations at `q`, `v` (7,), each (7,) [rad/s^2]."""
        limits = self._l
        return _bounds(q, v, limits.q_min, limits.q_max, limits.velocity, limits.acceleration, dt_s)

    def allows(self, torque: Array, qddot: Array, low: Array, high: Array) -> bool:
        """Whether torque (7,) [N m] and acceleration (7,) [rad/s^2] keep all limits."""
        return _allows(torque, self.torque, qddot, low, high)


@compiled
def _bounds(
    q: Array, v: Array, q_min: Array, q_max: Array, v_max: Array, a_max: Array, dt: float
) -> tuple[Array, Array]:
    low, high = np.empty(7), np.empty(7)
    for i in range(7):
        top = _SPEED_SHARE * v_max[i]
        up = min(top, stopping_speed(q_max[i] - q[i], BRAKING_SHARE * a_max[i], _GAIN_PER_S, dt))
        down = min(top, stopping_speed(q[i] - q_min[i], BRAKING_SHARE * a_max[i], _GAIN_PER_S, dt))
        high[i] = (up - v[i]) / (_HORIZON_TICKS * dt)
        low[i] = (-down - v[i]) / (_HORIZON_TICKS * dt)
    return low, high


@compiled
def _allows(torque: Array, torque_limit: Array, qddot: Array, low: Array, high: Array) -> bool:
    inside = True
    for i in range(7):
        inside = inside and abs(torque[i]) <= torque_limit[i] and low[i] <= qddot[i] <= high[i]
    return inside


class PriorityProgram:
    """Three quadratic programs: RCM rows first, then the tip rows, then the posture.

    Each minimises what its rows lack and holds what the ones above attained,

        min |J_i q'' - a_i|^2   subject to   J_j q'' = attained_j (j < i),  low <= q'' <= high,
                                             |M q'' + constant| <= tau_max

    so that under a limit the posture gives way first, then the tip, and the RCM last.
    """

    def __init__(self) -> None:
        self._levels = (DenseQp(), DenseQp(), DenseQp())

    def solve(
        self,
        M: Array,
        constant: Array,
        J: Array,
        a: Array,
        posture: Array,
        low: Array,
        high: Array,
        limits: AccelerationLimits,
    ) -> Array:
        """Joint acceleration (7,) [rad/s^2].

        Args:
            M: Inertia (7, 7).
            constant: Torque at zero acceleration (7,) [N m].
            J: Tip rows, then RCM rows (3 or 5, 7).
            a: Their accelerations (3 or 5,).
            posture: Acceleration of the posture (7,) [rad/s^2].
            low: Lower acceleration bounds (7,).
            high: Upper acceleration bounds (7,).
            limits: Whose torque limits hold.

        Raises:
            ControlFailure: If no acceleration keeps all limits.
        """
        inside = (-limits.torque - constant, limits.torque - constant)
        rows, lower, upper = M, inside[0], inside[1]
        found = posture
        for solver, J_i, a_i in zip(self._levels, (J[3:], J[:3], None), (a[3:], a[:3], posture), strict=True):
            if J_i is not None and len(J_i) == 0:
                continue
            H, f = _objective(J_i, a_i, M)
            x = solver.solve(H, f, low, high, rows, lower, upper)
            if x is None:
                break
            found = x
            if J_i is not None:
                attained = J_i @ x
                rows = np.concatenate((rows, J_i))
                lower = np.concatenate((lower, attained - _SLACK))
                upper = np.concatenate((upper, attained + _SLACK))
        if found is posture:
            data = {"M": M, "constant": constant, "low": low, "high": high}
            raise ControlFailure(Outcome.INFEASIBLE, "no joint acceleration keeps all limits", data)
        return found


def _objective(J: Array | None, a: Array, M: Array) -> tuple[Array, Array]:
    if J is None:
        return M, -M @ a
    return J.T @ J + _RIDGE * np.eye(7), -J.T @ a


_RIDGE = 1e-8
_SLACK = 1e-7
