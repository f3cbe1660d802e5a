"""Limits that exclude each other: which give way, and by how little."""

import numpy as np

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.tick.algebra import norm
from surgsim.tick.quadratic_program import SOLVED, solve

_RIDGE = 1e-8
_ROOM = 1e-7
"""What is given beyond the least, so that the programs that follow are not lost to rounding."""


@compiled
def relax(rows: Array, held: int, hard: int, lower: Array, upper: Array) -> bool:
    """Widen bounds until some q'' keeps all: first those of q'', then the rows after the `hard` ones.

    The hard rows stay as they are. What is widened lacks the least sum of squares,

        min |s|^2  subject to  low <= q'' - s <= high,  hard rows                       bounds of q''
        min |s|^2  subject to  g_l <= G q'' - |G| s <= g_u,  hard rows, low <= q'' <= high   the other rows

    Bounds that do not exclude each other stay as they are, to 2e-7.

    Args:
        rows: G in its first `held` rows (held or more, n).
        held: How many there are.
        hard: How many of them, from the first on, never give way.
        lower: Lower bounds of q'', then of G q'' (n + held or more,), changed.
        upper: Upper bounds, likewise.

    Returns:
        False if the hard rows exclude each other.
    """
    n = rows.shape[1]
    free_low, free_high = np.full(n, -np.inf), np.full(n, np.inf)
    each, s = np.eye(n), np.zeros(n)
    firm, firm_low, firm_high = rows[:hard], lower[n : n + hard], upper[n : n + hard]
    if not _lacks(each, lower[:n], upper[:n], firm, firm_low, firm_high, free_low, free_high, s):
        return False
    _widen(s, each, lower[:n], upper[:n])
    if held == hard:
        return True
    soft, low, high, lack = rows[hard:held], lower[n + hard : n + held], upper[n + hard : n + held], s[:0]
    lack = np.zeros(held - hard)
    if not _lacks(soft, low, high, firm, firm_low, firm_high, lower[:n], upper[:n], lack):
        return False
    _widen(lack, soft, low, high)
    return True


@compiled
def _widen(s: Array, rows: Array, lower: Array, upper: Array) -> None:
    """Bounds of rows that lack s (k,) of their lengths move out by it."""
    for i in range(s.size):
        by = s[i] * max(norm(rows[i]), _ROOM)
        if by > 0.0:
            upper[i] += by + _ROOM
        elif by < 0.0:
            lower[i] += by - _ROOM


@compiled
def _lacks(
    soft: Array,
    low: Array,
    high: Array,
    firm: Array,
    firm_low: Array,
    firm_high: Array,
    x_low: Array,
    x_high: Array,
    s: Array,
) -> bool:
    """Fill s (k,) with what the k soft rows lack under the firm ones and the bounds of x (n,)."""
    k, m, n = soft.shape[0], firm.shape[0], soft.shape[1]
    size = n + k
    H, f, G = np.zeros((size, size)), np.zeros(size), np.zeros((k + m, size))
    lower, upper = np.full(size, -np.inf), np.full(size, np.inf)
    g_low, g_high = np.empty(k + m), np.empty(k + m)
    lower[:n], upper[:n] = x_low, x_high
    for i in range(size):
        H[i, i] = _RIDGE if i < n else 1.0
    G[:k, :n], g_low[:k], g_high[:k] = soft, low, high
    for i in range(k):
        G[i, n + i] = -max(norm(soft[i]), _ROOM)
    G[k:, :n], g_low[k:], g_high[k:] = firm, firm_low, firm_high
    x, side = np.empty(size), np.zeros(size + k + m, np.int64)
    work, active = np.zeros((2 * size + 7, size + 1)), np.zeros(size + 1, np.int64)
    if solve(H, f, lower, upper, G, g_low, g_high, side, x, work, active) != SOLVED:
        return False
    for i in range(k):
        s[i] = x[n + i]
    return True
