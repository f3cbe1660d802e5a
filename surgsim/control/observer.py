"""What the arm's measured torque and motion tell: the disturbance torque, and the actuation delay."""

import math

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.tick.algebra import back_substitute, factor, times
from surgsim.tick.scratch import scratch, scratch_matrix

OFFSET_MEMORY_S = 0.05
"""Time constant of the mean difference between measured and commanded torque [s]."""


def observer_size(n: int) -> int:
    """Length of the disturbance observer's memory: d, rest and v (n,) each, inertia (n, n)."""
    return n * (n + 3)


@compiled
def observe(
    memory: Array,
    first: bool,
    M: Array,
    bias: Array,
    damping: Array,
    v: Array,
    tau: Array,
    gain: float,
    dt: float,
) -> Array:
    """Attribute unexplained changes of the joint velocities to a disturbance torque d, a view of `memory`.

        v^(k+1) = v(k) + T (M + T D)^-1 (tau + d - bias - D v)
        d      += L (M + T D) (v(k+1) - v^(k+1)) / T

    with tau the torque that was measured over the period. d, in M q'' + bias + D q' = tau + d, follows a
    constant disturbance as a first-order lag with the time constant T / L. It is the discrete form of the
    momentum observer of De Luca et al. 2006, for MuJoCo's implicit joint damping.

    Args:
        memory: Of `observer_size`, changed in place: d, rest = bias + D q' - d of the last tick [N m], its
            velocity [rad/s], its inertia M + T D.
        first: Whether nothing is known yet.
        M: Nominal inertia (n, n).
        bias: Nominal Coriolis, centrifugal and gravity torque (n,) [N m].
        damping: D (n,) [N m s/rad].
        v: Joint velocities now (n,) [rad/s].
        tau: Torque that acted over the last period (n,) [N m].
        gain: L, from 0 (off) to 1 (dead beat).
        dt: Control period T [s].
    """
    n = v.size
    d, rest, last = memory[:n], memory[n : 2 * n], memory[2 * n : 3 * n]
    inertia = memory[3 * n : 3 * n + n * n].reshape((n, n))
    if first:
        d[:] = 0.0
    else:
        for j in range(n):
            last[j] = (v[j] - last[j]) / dt
        for i in range(n):
            s = 0.0
            for j in range(n):
                s += inertia[i, j] * last[j]
            d[i] += gain * (s - (tau[i] - rest[i]))
    for i in range(n):
        for j in range(n):
            inertia[i, j] = M[i, j]
        inertia[i, i] += dt * damping[i]
        rest[i] = bias[i] + damping[i] * v[i] - d[i]
        last[i] = v[i]
    return d


def position_observer_size(n: int) -> int:
    """Length of the memory of `observe_positions`: q, v, d and rest (n,) each, inertia (n, n)."""
    return n * (n + 4)


@compiled
def observe_positions(
    memory: Array,
    first: bool,
    M: Array,
    bias: Array,
    damping: Array,
    q: Array,
    tau: Array,
    gains: tuple[float, float, float],
    dt: float,
) -> Array:
    """The same disturbance torque d from positions alone: no velocity is measured or differentiated.

        v+ = v + T M^-1 (tau + d - bias - D v),  q+ = q + T (v + v+)/2
        q += a e,  v += b e/T,  d += g M e/T^2,  e = q_m - q

    with the gains a, b, g of `surgsim.control.filters.filter_gains`.

    Args:
        memory: Of `position_observer_size`, changed in place.
        first: Whether nothing is known yet: the arm is at rest, and d is what its torques bear too much.
        M: Nominal inertia (n, n).
        bias: Nominal Coriolis, centrifugal and gravity torque (n,) [N m].
        damping: D (n,) [N m s/rad].
        q: Measured joint positions (n,) [rad].
        tau: Torque that acted over the last period (n,) [N m].
        gains: a, b, g.
        dt: Control period T [s].
    """
    n = q.size
    known, speed, d, rest = memory[:n], memory[n : 2 * n], memory[2 * n : 3 * n], memory[3 * n : 4 * n]
    inertia = memory[4 * n : 4 * n + n * n].reshape((n, n))
    if first:
        for i in range(n):
            known[i], speed[i], d[i] = q[i], 0.0, bias[i] - tau[i]
    else:
        L, rate, e = scratch_matrix(n, n), scratch(n), scratch(n)
        L[:] = inertia
        if factor(L):
            for i in range(n):
                rate[i] = tau[i] - rest[i] - damping[i] * speed[i] + d[i]
            back_substitute(L, rate)
            for i in range(n):
                known[i] += dt * (speed[i] + 0.5 * dt * rate[i])
                speed[i] += dt * rate[i]
        for i in range(n):
            e[i] = q[i] - known[i]
        times(inertia, e, rate)
        for i in range(n):
            known[i] += gains[0] * e[i]
            speed[i] += gains[1] * e[i] / dt
            d[i] += gains[2] * rate[i] / (dt * dt)
    for i in range(n):
        rest[i] = bias[i]
        for j in range(n):
            inertia[i, j] = M[i, j]
    return d


def delay_size(n: int, most: int) -> int:
    """Length of the delay estimate's memory: commands, scores, offset and ticks.

    `most` is the longest delay in periods, n the number of joints.
    """
    return (most + 1) * (n + 1) + n + 1


@compiled
def estimate_delay(memory: Array, first: bool, measured: Array, most: int, dt: float) -> int:
    """By how many periods the measured torque lags behind the commanded one, 0 to `most`.

    Each candidate delay is scored by a fading sum of its squared mismatch; the best one counts, the shorter
    one where they are equal, as at rest. The slow mean of measured less commanded torque, of a drive or
    sensor that is biased, is kept beside it, see `torque_offset`.

    Args:
        memory: Of `delay_size`, changed in place.
        first: Whether no command is known yet.
        measured: Torque of the last period (n,) [N m].
        most: Longest delay in periods.
        dt: Control period [s].
    """
    n = measured.size
    commands = memory[: (most + 1) * n].reshape((most + 1, n))
    scores = memory[(most + 1) * n : (most + 1) * (n + 1)]
    offset = torque_offset(memory, most, n)
    if first:
        commands[:] = math.nan
        scores[:] = 0.0
        offset[:] = 0.0
    best = _score(commands, scores, measured)
    if math.isfinite(commands[most, 0]):  # before, a delay may not have shown
        for i in range(n):
            offset[i] += dt / OFFSET_MEMORY_S * (measured[i] - commands[best, i] - offset[i])
    memory[memory.size - 1] = best
    return best


@compiled
def torque_offset(memory: Array, most: int, n: int) -> Array:
    """The slow mean of measured less commanded torque (n,) [N m], a view of the delay estimate's memory."""
    return memory[(most + 1) * (n + 1) : (most + 1) * (n + 1) + n]


@compiled
def remember_command(memory: Array, most: int, torque: Array) -> None:
    """Remember the torque (n,) [N m] that is commanded now; the newest comes first."""
    n = torque.size
    for i in range((most + 1) * n - 1, n - 1, -1):
        memory[i] = memory[i - n]
    for i in range(n):
        memory[i] = torque[i]


@compiled
def _score(commands: Array, scores: Array, measured: Array) -> int:
    best = 0
    for n in range(scores.size):
        row = n if math.isfinite(commands[n, 0]) else n - 1
        while row > 0 and not math.isfinite(commands[row, 0]):
            row -= 1  # before the first command, the queue held the first one
        mismatch = 0.0
        if math.isfinite(commands[row, 0]):
            for i in range(measured.size):
                mismatch += (measured[i] - commands[row, i]) * (measured[i] - commands[row, i])
        scores[n] = 0.9 * scores[n] + mismatch
        if scores[n] < scores[best] - 1e-12 - 1e-6 * scores[best]:
            best = n
    return best
