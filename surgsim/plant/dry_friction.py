"""Dry friction of joints that are coupled by their inertia, within a step."""

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.tick.algebra import back_substitute, factor
from surgsim.tick.scratch import scratch, scratch_matrix

_SWEEPS, _ROUNDS = 6, 60
_ROUNDING = 1e-9


@compiled
def rub(inverse: Array, most: Array, friction: Array, v: Array) -> bool:
    """Take dry friction off the velocities at the end of a step.

    Friction holds a joint that it can hold, and else opposes its motion with all that it has:

        v = v_free - A f,   |f_i| <= F_i,   f_i < F_i  =>  v_i <= 0,   f_i > -F_i  =>  v_i >= 0

    A few sweeps of projected Gauss-Seidel, from the friction of the last step, tell which joints stick; for
    those v_i = 0 is solved exactly. If a joint then holds with more than it has, or slides with its friction,
    further sweeps follow, and so on.

    Args:
        inverse: A, what a torque over the step does to the velocities (n, n) [rad/(s N m)].
        most: F, dry friction of each joint (n,) [N m].
        friction: f of the last step; filled with that of this one (n,) [N m].
        v: v_free; filled with v (n,) [rad/s].

    Returns:
        Whether that is the solution; else the sweeps' last answer, which takes energy out too.

    Source: Moreau's time-stepping with a box-constrained complementarity problem for each step, e.g. Acary
    and Brogliato, Numerical Methods for Nonsmooth Dynamical Systems (2008), chapter 10.
    """
    n = v.size
    _apply(inverse, friction, v)
    trial, slid = scratch(n), scratch(n)
    for _ in range(_ROUNDS):
        for _ in range(_SWEEPS):
            _sweep(inverse, most, friction, v)
        if _hold(inverse, most, friction, v, trial, slid):
            friction[:], v[:] = trial, slid
            return True
    return False


@compiled
def _apply(inverse: Array, f: Array, v: Array) -> None:
    """Take A f off v."""
    for i in range(f.size):
        for j in range(f.size):
            v[j] -= inverse[j, i] * f[i]


@compiled
def _sweep(inverse: Array, most: Array, friction: Array, v: Array) -> None:
    """Let each joint in turn have the friction that its velocity asks for."""
    for i in range(v.size):
        if most[i] > 0.0:
            wanted = friction[i] + v[i] / inverse[i, i]
            change = min(max(wanted, -most[i]), most[i]) - friction[i]
            friction[i] += change
            for j in range(v.size):
                v[j] -= inverse[j, i] * change


@compiled
def _hold(inverse: Array, most: Array, friction: Array, v: Array, f: Array, after: Array) -> bool:
    """Bring the joints to rest that stick, by what `friction` and `v` say; whether that is the solution.

    Args:
        inverse: A.
        most: F.
        friction: Friction so far (n,) [N m].
        v: Velocities with it (n,) [rad/s].
        f: Filled with the friction (n,) [N m].
        after: Filled with the velocities with that (n,) [rad/s].
    """
    n, count = v.size, 0
    place, rest, held = scratch(n), scratch(n), scratch_matrix(n, n)
    for i in range(n):
        f[i], after[i] = friction[i], v[i]
        if most[i] > 0.0 and abs(friction[i]) < most[i]:
            place[count], rest[count] = i, v[i]
            count += 1
    for a in range(count):
        for b in range(count):
            held[a, b] = inverse[int(place[a]), int(place[b])]
    if count > 0:
        if not factor(held[:count, :count]):
            return False
        back_substitute(held[:count, :count], rest[:count])
    for a in range(count):
        i = int(place[a])
        f[i] += rest[a]
        for j in range(n):
            after[j] -= inverse[j, i] * rest[a]
        if abs(f[i]) > most[i] * (1.0 + _ROUNDING):
            return False
    fastest = 0.0
    for i in range(n):
        fastest = max(fastest, abs(after[i]))
    for i in range(n):
        slides = most[i] > 0.0 and abs(friction[i]) >= most[i]
        if slides and after[i] * friction[i] < -_ROUNDING * fastest * most[i]:
            return False
    for a in range(count):
        after[int(place[a])] = 0.0
    return True
