"""Joint accelerations inside torque, velocity and position limits, in strict priority."""

import numpy as np

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.control.bounds import BRAKING_SHARE, stopping_speed
from surgsim.tick.algebra import dot, times
from surgsim.tick.arrays import Seen
from surgsim.tick.quadratic_program import SOLVED, solve
from surgsim.tick.status import GOES_ON, INFEASIBLE

SPEED_SHARE = 0.97
TORQUE_SHARE = 0.999
_HORIZON_TICKS = 5.0
_GAIN_PER_S = 10.0
_RIDGE = 1e-8
_SLACK = 1e-7


@compiled
def fill_acceleration_bounds(seen: Seen, q: Array, v: Array, low: Array, high: Array) -> None:
    """Accelerations from which no joint passes its velocity limit, nor fails to stop before its range.

    A velocity bound v_b is approached as q'' <= (v_b - q') / (5 T), so that a wrong inertia of the model does
    not carry a joint past it.

    Args:
        seen: Limits and control period.
        q: Joint positions (n,) [rad].
        v: Joint velocities (n,) [rad/s].
        low: Filled with the lower bounds (n,) [rad/s^2].
        high: Filled with the upper bounds (n,) [rad/s^2].
    """
    ahead = _HORIZON_TICKS * seen.dt_s
    for i in range(q.size):
        high[i] = (top_speed(seen, i, seen.q_max[i] - q[i]) - v[i]) / ahead
        low[i] = (-top_speed(seen, i, q[i] - seen.q_min[i]) - v[i]) / ahead


@compiled
def allows(torque: Array, torque_limit: Array, qddot: Array, seen: Seen, q: Array, v: Array) -> bool:
    """Whether torque (n,) [N m] and acceleration (n,) [rad/s^2] keep all limits.

    The bounds of acceleration are those of `fill_acceleration_bounds`. Only the one that a joint is on its
    way to is looked at: the other one cannot be passed.
    """
    ahead = _HORIZON_TICKS * seen.dt_s
    for i in range(torque.size):
        if not abs(torque[i]) <= torque_limit[i]:
            return False
        reached = v[i] + ahead * qddot[i]
        room = seen.q_max[i] - q[i] if reached > 0.0 else q[i] - seen.q_min[i]
        if not abs(reached) <= top_speed(seen, i, room):
            return False
    return True


@compiled
def top_speed(seen: Seen, i: int, room: float) -> float:
    """Speed [rad/s] that joint i may have with `room` [rad] left before its range ends."""
    stop = BRAKING_SHARE * seen.a_max[i]
    speed: float = min(SPEED_SHARE * seen.v_max[i], stopping_speed(room, stop, _GAIN_PER_S, seen.dt_s))
    return speed


@compiled
def prioritised(
    M: Array,
    constant: Array,
    J: Array,
    a: Array,
    posture: Array,
    low: Array,
    high: Array,
    torque_limit: Array,
    qddot: Array,
) -> int:
    """Three quadratic programs: RCM rows first, then the tip rows, then the posture.

    Each minimises what its rows lack and holds what the ones above attained,

        min |J_i q'' - a_i|^2   subject to   J_j q'' = attained_j (j < i),  low <= q'' <= high,
                                             |M q'' + constant| <= tau_max

    so that under a limit the posture gives way first, then the tip, and the RCM last. What a level attains
    meets the rows of the next, so that none of them can be lost: a level without an answer is a failure.

    Args:
        M: Inertia (n, n).
        constant: Torque at zero acceleration (n,) [N m].
        J: Tip rows, then RCM rows (3 or 5, n).
        a: Their accelerations (3 or 5,).
        posture: Acceleration of the posture (n,) [rad/s^2].
        low: Lower acceleration bounds (n,) [rad/s^2].
        high: Upper acceleration bounds (n,) [rad/s^2].
        torque_limit: tau_max (n,) [N m].
        qddot: Filled with the joint acceleration (n,) [rad/s^2].

    Returns:
        GOES_ON, or INFEASIBLE if no acceleration keeps all limits.
    """
    n, m = posture.size, J.shape[0]
    rows, lower, upper = np.empty((n + m, n)), np.empty(2 * n + m), np.empty(2 * n + m)
    rows[:n] = M
    for i in range(n):
        lower[i], upper[i] = low[i], high[i]
        lower[n + i], upper[n + i] = -torque_limit[i] - constant[i], torque_limit[i] - constant[i]
    return cascade(M, J, a, posture, rows, n, lower, upper, qddot)


@compiled
def cascade(
    M: Array,
    J: Array,
    a: Array,
    posture: Array,
    rows: Array,
    held: int,
    lower: Array,
    upper: Array,
    qddot: Array,
) -> int:
    """The programs of `prioritised` under any limits: bounds of q'', and rows G q'' between bounds.

    Args:
        M: Inertia (n, n).
        J: Tip rows, then RCM rows (3 or 5, n).
        a: Their accelerations (3 or 5,).
        posture: Acceleration of the posture (n,) [rad/s^2].
        rows: G in its first `held` rows, then room for J (held + 3 or 5, n), which is written.
        held: How many rows limits take.
        lower: Lower bounds of q'', then of G q'', then room (n + held + 3 or 5,); changed by rounding.
        upper: Upper bounds, likewise.
        qddot: Filled with the joint acceleration (n,) [rad/s^2].

    Returns:
        GOES_ON, or INFEASIBLE if no acceleration keeps all limits.
    """
    n, m = posture.size, J.shape[0]
    H, f, value = np.empty((n, n)), np.empty(n), np.empty(held + m)
    work, active, side = (
        np.zeros((2 * n + 7, n + 1)),
        np.zeros(n + 1, np.int64),
        np.zeros(n + held + m, np.int64),
    )
    least, most = lower[:n], upper[:n]
    below, above = lower[n:], upper[n:]
    for level in range(3):
        begin, end = (3, m) if level == 0 else (0, 3)
        if level < 2 and end == begin:
            continue
        if level < 2:
            _least_squares(J[begin:end], a[begin:end], H, f)
        else:
            H[:] = M
            times(M, posture, f)
            for i in range(n):
                f[i] = -f[i]
        found = solve(
            H, f, least, most, rows[:held], below[:held], above[:held], side[: n + held], qddot, work, active
        )
        if found != SOLVED:
            return INFEASIBLE
        if level == 2:
            break
        times(rows[:held], qddot, value[:held])
        _admit(value[:held], below, above)
        _admit(qddot, least, most)
        for i in range(begin, end):
            rows[held] = J[i]
            s = dot(J[i], qddot)
            below[held], above[held] = s - _SLACK, s + _SLACK
            held += 1
    return GOES_ON


@compiled
def _admit(x: Array, low: Array, high: Array) -> None:
    """Widen bounds by the rounding that x (k,) misses them by: no reason to lose the next level."""
    for i in range(x.size):
        low[i], high[i] = min(low[i], x[i]), max(high[i], x[i])


@compiled
def _least_squares(J: Array, a: Array, H: Array, f: Array) -> None:
    """H = J^T J and a small ridge, f = -J^T a."""
    for i in range(f.size):
        s = 0.0
        for k in range(a.size):
            s -= J[k, i] * a[k]
        f[i] = s
        for j in range(f.size):
            s = _RIDGE if i == j else 0.0
            for k in range(a.size):
                s += J[k, i] * J[k, j]
            H[i, j] = s
