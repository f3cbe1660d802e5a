"""Tasks under limits as quadratic programs, in strict priority or weighted; limits that conflict give way."""

import numpy as np

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.control.acceleration import cascade
from surgsim.control.relaxation import relax
from surgsim.tick.algebra import times
from surgsim.tick.quadratic_program import SOLVED, solve
from surgsim.tick.status import GOES_ON, INFEASIBLE


@compiled
def _solve(
    M: Array,
    J: Array,
    a: Array,
    posture: Array,
    weights: Array,
    rows: Array,
    held: int,
    lower: Array,
    upper: Array,
    sides: Array,
    qddot: Array,
) -> bool:
    """Fill qddot (n,); False if the limits exclude each other.

    In strict priority all tasks are first asked for as equalities, with the posture as the objective: an
    answer to that is the cascade's, in one program. Only where there is none the levels are gone through.
    """
    n, m, strict = posture.size, a.size, weights[1] == 0.0
    H, f = np.empty((n, n)), np.empty(n)
    times(M, posture, f)
    for i in range(n):
        f[i] *= -1.0 if strict else -weights[2]
        for j in range(n):
            H[i, j] = M[i, j] if strict else weights[2] * M[i, j]
    k = held + m if strict else held
    if strict:
        rows[held:k], lower[n + held : n + k], upper[n + held : n + k] = J, a, a
    else:
        for r in range(m):
            weight = weights[1] if r < 3 else weights[0]
            for i in range(n):
                f[i] -= weight * J[r, i] * a[r]
                for j in range(n):
                    H[i, j] += weight * J[r, i] * J[r, j]
    work, active, side = np.zeros((2 * n + 7, n + 1)), np.zeros(n + 1, np.int64), np.empty(n + k, np.int64)
    for i in range(n + k):
        side[i] = int(sides[i])
    found = solve(
        H,
        f,
        lower[:n],
        upper[:n],
        rows[:k],
        lower[n : n + k],
        upper[n : n + k],
        side,
        qddot,
        work,
        active,
    )
    if found == SOLVED:
        for i in range(n + k):
            sides[i] = side[i]
        return True
    sides[:] = 0.0
    if not strict or cascade(M, J, a, posture, rows, held, lower, upper, qddot) != GOES_ON:
        return False
    sides[0] = 1.0  # a limit is active: no task would be given up otherwise
    return True


@compiled
def solve_tasks(
    M: Array,
    J: Array,
    a: Array,
    posture: Array,
    weights: Array,
    rows: Array,
    held: int,
    hard: int,
    lower: Array,
    upper: Array,
    sides: Array,
    qddot: Array,
    free: Array,
) -> tuple[int, bool]:
    """The joint acceleration of the tasks under limits, and the one that they would get without.

    Args:
        M: Inertia (n, n).
        J: Tip rows, then RCM rows (3 or 5, n).
        a: Their accelerations (3 or 5,).
        posture: Acceleration of the posture (n,) [rad/s^2].
        weights: Of RCM, tip and posture (3,); zeros: strict priority, RCM > tip > posture.
        rows: G in its first `held` rows, then room for J (held + 3 or 5, n).
        held: How many rows limits take.
        hard: How many of them, from the first on, never give way.
        lower: Lower bounds of q'', then of G q'', then room (n + held + 3 or 5,); changed in a conflict.
        upper: Upper bounds, likewise.
        sides: Active rows of the last program, zeros at first (n + held + 3 or 5,); changed to this one's.
        qddot: Filled (n,) [rad/s^2].
        free: Filled with the answer without any limit (n,) [rad/s^2].

    Returns:
        GOES_ON or INFEASIBLE; whether limits excluded each other, so that some gave way.
    """
    n, m, gave_way = posture.size, a.size, False
    if not _solve(M, J, a, posture, weights, rows, held, lower, upper, sides, qddot):
        gave_way = True
        if not relax(rows, held, hard, lower, upper):
            return INFEASIBLE, True
        sides[:] = 0.0
        if not _solve(M, J, a, posture, weights, rows, held, lower, upper, sides, qddot):
            return INFEASIBLE, True
    limited = gave_way
    for k in range(n + held):
        limited = limited or sides[k] != 0.0
    if not limited:
        free[:] = qddot
        return GOES_ON, False
    room, least, most = np.empty((m, n)), np.full(n + m, -np.inf), np.full(n + m, np.inf)
    if not _solve(M, J, a, posture, weights, room, 0, least, most, np.zeros(n + m), free):
        return INFEASIBLE, gave_way
    return GOES_ON, gave_way
