"""Bounds of joint velocities: ranges and speeds, and room to stop."""

import math

from surgsim.array import Array
from surgsim.compiled import compiled

BRAKING_SHARE = 0.5


@compiled
def fill_velocity_bounds(
    q: Array, q_min: Array, q_max: Array, v_max: Array, gain: float, lower: Array, upper: Array
) -> None:
    """Omega of the VPRNN paper: velocity limits, tightened as a joint nears its position limit.

        max(-v_max, -alpha (q - q_min)) <= q' <= min(v_max, alpha (q_max - q))

    A joint already past its limit gets the bound that drives it back, capped by its velocity limit.

    Args:
        q: Joint positions (n,) [rad].
        q_min: Lowest positions (n,) [rad].
        q_max: Highest positions (n,) [rad].
        v_max: Velocity limits (n,) [rad/s].
        gain: alpha [1/s].
        lower: Filled with the lower bounds (n,) [rad/s].
        upper: Filled with the upper bounds (n,) [rad/s].
    """
    for i in range(q.size):
        lower[i] = min(max(-v_max[i], gain * (q_min[i] - q[i])), v_max[i])
        upper[i] = max(min(v_max[i], gain * (q_max[i] - q[i])), -v_max[i])


@compiled
def stopping_speed(room: float, a: float, gain: float, dt: float) -> float:
    """Speed from which `a` suffices to stay below gain * room, Omega's bound, until standstill.

    The parabola of constant deceleration meets the line gain * room with equal slope at the speed a / gain.
    One period's travel is taken off the room first.
    """
    if room <= a / (gain * gain):
        return gain * max(room, 0.0)
    reach = a * dt
    return math.sqrt(reach * reach + 2.0 * a * (room - 0.5 * a / (gain * gain))) - reach


@compiled
def fill_braking_bounds(
    q: Array,
    last: Array,
    lower: Array,
    upper: Array,
    q_min: Array,
    q_max: Array,
    a_max: Array,
    gain: float,
    dt: float,
    low: Array,
    high: Array,
) -> None:
    """Omega with acceleration limits: reachable from `last` (n,) [rad/s], and able to stop in time.

    |q' - last| <= a_max T, and the speed towards a position limit is one from which half of a_max
    can stop in time: the task rows couple the joints, so that another joint may have to brake harder.
    Where these exclude each other, Omega and the room to stop hold before the acceleration limit.

    Args:
        q: Joint positions (n,) [rad].
        last: Joint velocities of the last tick (n,) [rad/s].
        lower: Omega's lower bounds (n,) [rad/s].
        upper: Omega's upper bounds (n,) [rad/s].
        q_min: Lowest positions (n,) [rad].
        q_max: Highest positions (n,) [rad].
        a_max: Acceleration limits (n,) [rad/s^2].
        gain: alpha of Omega [1/s].
        dt: Control period [s].
        low: Filled with the lower bounds (n,) [rad/s].
        high: Filled with the upper bounds (n,) [rad/s].
    """
    for i in range(last.size):
        reach, stop = a_max[i] * dt, BRAKING_SHARE * a_max[i]
        high[i] = min(upper[i], max(stopping_speed(q_max[i] - q[i], stop, gain, dt), lower[i]))
        low[i] = max(lower[i], min(-stopping_speed(q[i] - q_min[i], stop, gain, dt), upper[i]))
        fastest, slowest = last[i] + reach, last[i] - reach
        high[i] = min(high[i], fastest) if fastest >= low[i] else low[i]
        low[i] = max(low[i], slowest) if slowest <= high[i] else high[i]
