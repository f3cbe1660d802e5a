"""Dense strictly convex quadratic programs in a kernel: exact, warm, infeasibility told.

    min 1/2 x^T H x + f^T x   subject to   lower <= x <= upper,  G_lower <= G x <= G_upper

A row with equal bounds is an equality. A dual active-set method: the QR factors of the active rows in the
metric of H are updated row by row, with K = Q^T L^-1, H = L L^T, so that K g = (R; 0) for the active rows g.
Multipliers and x are computed anew from the active set in every iteration, so that nothing drifts.

    y from R^T y = b,   lambda from R lambda = -(K f)_q - y,   x = K^T (y; -(K f)_rest)

Source: Goldfarb and Idnani, Mathematical Programming 27:1 (1983), with the dual steps of a bounded
least-squares method in place of its drop rule.
"""

import math

import numpy as np
from numpy.typing import NDArray

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.tick.algebra import factor, norm

Ids = NDArray[np.int64]

SOLVED = 1
INFEASIBLE = -1
LIMIT = -4
NONCONVEX = -5

FEASIBLE = 1e-9
"""A row is kept if it is missed by less than this, relative to its length and bound."""
_DEPENDENT = 1e-10
_DUAL = 1e-12
_EQUALITY = 2
_LEFT = 3  # a row that depends on the active ones, and is missed by no more than rounding explains


def workspace(n: int, rows: int) -> tuple[Array, Ids, Ids]:
    """Scratch of `solve` for n variables: work (2n + 7, n + 1), active (n + 1,), side (n + rows,)."""
    return np.zeros((2 * n + 7, n + 1)), np.zeros(n + 1, dtype=np.int64), np.zeros(n + rows, dtype=np.int64)


@compiled
def _inverse_factor(H: Array, K: Array) -> bool:
    """K[:, :n] = L^-1 with H = L L^T; False where H is not positive definite."""
    n = H.shape[0]
    diagonal = True
    for i in range(n):
        for j in range(i):
            K[i, j], K[j, i] = H[i, j], 0.0
            diagonal = diagonal and H[i, j] == 0.0
        K[i, i] = H[i, i]
    if diagonal:
        for i in range(n):
            if not K[i, i] > 0.0:
                return False
            K[i, i] = 1.0 / math.sqrt(K[i, i])
        return True
    if not factor(K):
        return False
    for i in range(n):
        scale = 1.0 / K[i, i]
        for j in range(i):
            s = 0.0
            for k in range(j, i):
                s += K[i, k] * K[k, j]
            K[i, j] = -s * scale
        K[i, i] = scale
    return True


@compiled
def _image(K: Array, G: Array, k: int, d: Array) -> None:
    """D = K g of row k: a bound of x_k, or row k - n of G."""
    n = d.size
    if k < n:
        for i in range(n):
            d[i] = K[i, k]
        return
    for i in range(n):
        s = 0.0
        for j in range(n):
            s += K[i, j] * G[k - n, j]
        d[i] = s


@compiled
def _is_independent(d: Array, q: int) -> bool:
    """Whether a row with the image d is not a combination of the q active ones."""
    rest = whole = 0.0
    for i in range(d.size):
        whole += d[i] * d[i]
        if i >= q:
            rest += d[i] * d[i]
    return q < d.size and rest > _DEPENDENT * _DEPENDENT * whole


@compiled
def _append(K: Array, R: Array, q: int, d: Array, w: Array) -> None:
    """The row with the image d becomes the q-th active: reflect K's rows q.., so that d ends there."""
    n = d.size
    s = 0.0
    for i in range(q, n):
        s += d[i] * d[i]
    a = math.sqrt(s)
    if d[q] > 0.0:
        a = -a
    for i in range(q):
        R[i, q] = d[i]
    R[q, q] = a
    d[q] -= a
    if q == n - 1:
        for j in range(w.size):
            K[q, j] = -K[q, j]
        return
    beta = -1.0 / (a * d[q])
    for j in range(w.size):
        w[j] = d[q] * K[q, j]
    for i in range(q + 1, n):
        for j in range(w.size):
            w[j] += d[i] * K[i, j]
    for i in range(q, n):
        c = beta * d[i]
        for j in range(w.size):
            K[i, j] -= c * w[j]


@compiled
def _remove(K: Array, R: Array, q: int, at: int, active: Ids, b: Array, multiplier: Array) -> None:
    """Take the active row `at` out of q, by rotations that keep R triangular."""
    for c in range(at, q - 1):
        active[c], b[c], multiplier[c] = active[c + 1], b[c + 1], multiplier[c + 1]
        for i in range(c + 2):
            R[i, c] = R[i, c + 1]
        h = math.sqrt(R[c, c] * R[c, c] + R[c + 1, c] * R[c + 1, c])
        cosine, sine = R[c, c] / h, R[c + 1, c] / h
        R[c, c], R[c + 1, c] = h, 0.0
        for j in range(c + 2, q):
            u, v = R[c, j], R[c + 1, j]
            R[c, j], R[c + 1, j] = cosine * u + sine * v, cosine * v - sine * u
        for j in range(K.shape[1]):
            u, v = K[c, j], K[c + 1, j]
            K[c, j], K[c + 1, j] = cosine * u + sine * v, cosine * v - sine * u


@compiled
def _miss(
    x: Array, lower: Array, upper: Array, G: Array, G_lower: Array, G_upper: Array, k: int
) -> tuple[float, int]:
    """By how much row k is missed, relative to its length and bound, and on which side; (0, 0) if kept."""
    n = x.size
    value, size, low, high = 0.0, 1.0, 0.0, 0.0
    if k < n:
        value, low, high = x[k], lower[k], upper[k]
    else:
        low, high = G_lower[k - n], G_upper[k - n]
        for j in range(n):
            value += G[k - n, j] * x[j]
    if low <= value <= high:
        return 0.0, 0
    if k >= n:
        size = norm(G[k - n])
    if value > high:
        return (value - high) / (size + abs(high)), 1
    return (low - value) / (size + abs(low)), -1


@compiled
def _begin(
    lower: Array,
    upper: Array,
    G: Array,
    G_lower: Array,
    G_upper: Array,
    side: Ids,
    work: Array,
    active: Ids,
) -> tuple[int, int]:
    """Take in the equalities, then the guess in `side`; numbers of active rows and of equalities, or -1."""
    n = lower.size
    K, R, b, multiplier = work[:n], work[n : 2 * n], work[2 * n], work[2 * n + 2]
    d, w = work[2 * n + 4, :n], work[2 * n + 6]
    q = equal = 0
    for sweep in range(2):
        for k in range(n + G_lower.size):
            low = lower[k] if k < n else G_lower[k - n]
            high = upper[k] if k < n else G_upper[k - n]
            if low > high:
                return -1, 0
            if (sweep == 0) != (low == high):
                continue
            guess = side[k]
            side[k] = 0
            bound = high if guess > 0 else low
            if (sweep == 1 and guess == 0) or q == n or not math.isfinite(bound):
                continue
            _image(K, G, k, d)
            if not _is_independent(d, q):  # a dependent equality is checked as any other row
                continue
            _append(K, R, q, d, w)
            active[q], b[q], multiplier[q] = k, bound, 0.0
            side[k] = _EQUALITY if sweep == 0 else (1 if guess > 0 else -1)
            q += 1
        if sweep == 0:
            equal = q
    return q, equal


@compiled
def _stationary(K: Array, R: Array, q: int, b: Array, y: Array, star: Array) -> None:
    """Y and the multipliers `star` of the q active rows."""
    n = K.shape[0]
    for i in range(q):
        s = b[i]
        for j in range(i):
            s -= R[j, i] * y[j]
        y[i] = s / R[i, i]
    for i in range(q - 1, -1, -1):
        s = -K[i, n] - y[i]
        for j in range(i + 1, q):
            s -= R[i, j] * star[j]
        star[i] = s / R[i, i]


@compiled
def _blocking(
    q: int, equal: int, side: Ids, active: Ids, multiplier: Array, star: Array
) -> tuple[float, int]:
    """How far the multipliers may go towards `star`, and the row whose multiplier is zero there; -1: none."""
    step, out = 1.0, -1
    for i in range(equal, q):
        if side[active[i]] * star[i] < -_DUAL:
            t = multiplier[i] / (multiplier[i] - star[i]) if multiplier[i] != star[i] else 0.0
            if t < step:
                step, out = t, i
    return step, out


@compiled
def _exchange(
    R: Array, q: int, equal: int, d: Array, r: Array, way: int, side: Ids, active: Ids, multiplier: Array
) -> tuple[float, int, float]:
    """For a row that depends on the active ones: the dual step, the row that leaves, the row's length."""
    size = 1.0
    for i in range(q - 1, -1, -1):
        s = d[i]
        for j in range(i + 1, q):
            s -= R[i, j] * r[j]
        r[i] = s / R[i, i]
        size += abs(r[i])
    step, out = math.inf, -1
    for i in range(equal, q):
        rate = way * r[i] * side[active[i]]
        if rate > _DEPENDENT:
            t = multiplier[i] * side[active[i]] / rate
            if t < step:
                step, out = t, i
    return step, out, size


@compiled
def _look_again(side: Ids, left: int) -> int:
    """The active rows have changed, so that the rows which were left are looked at again; 0."""
    if left > 0:
        for k in range(side.size):
            if side[k] == _LEFT:
                side[k] = 0
    return 0


@compiled
def solve(
    H: Array,
    f: Array,
    lower: Array,
    upper: Array,
    G: Array,
    G_lower: Array,
    G_upper: Array,
    side: Ids,
    x: Array,
    work: Array,
    active: Ids,
) -> int:
    """Solve the program; SOLVED, INFEASIBLE, LIMIT or NONCONVEX.

    Everything must be finite but for bounds, which may be infinite.

    Args:
        H: Symmetric, positive definite (n, n).
        f: (n,).
        lower: (n,).
        upper: (n,).
        G: Rows (m, n).
        G_lower: (m,).
        G_upper: (m,).
        side: Which bound of each of the n + m rows is active, -1 lower, 1 upper, 0 none, 2 an equality:
            read as a guess, the last solution's or zeros, and written.
        x: Filled with the minimiser (n,).
        work: Scratch from `workspace`.
        active: Scratch from `workspace`; its last entry counts the iterations.
    """
    n, m = f.size, G_lower.size
    K, R = work[:n], work[n : 2 * n]
    b, y, multiplier, star = work[2 * n], work[2 * n + 1], work[2 * n + 2], work[2 * n + 3]
    d, r, w = work[2 * n + 4, :n], work[2 * n + 5], work[2 * n + 6]
    if not _inverse_factor(H, K):
        return NONCONVEX
    for i in range(n):  # the last column follows K f
        s = 0.0
        for j in range(i + 1):
            s += K[i, j] * f[j]
        K[i, n] = s
    q, equal = _begin(lower, upper, G, G_lower, G_upper, side, work, active)
    if q < 0:
        return INFEASIBLE
    newest = barred = -1
    left = 0
    for count in range(1, 10 * (n + m) + 1):
        active[n] = count
        _stationary(K, R, q, b, y, star)
        step, out = _blocking(q, equal, side, active, multiplier, star)
        if out >= 0:
            for i in range(q):
                multiplier[i] += step * (star[i] - multiplier[i])
            if active[out] == newest:
                barred = newest
            side[active[out]] = 0
            _remove(K, R, q, out, active, b, multiplier)
            q -= 1
            left = _look_again(side, left)
            continue
        for j in range(n):
            x[j] = 0.0
        for i in range(n):
            c = -K[i, n]
            if i < q:
                multiplier[i], c = star[i], y[i]
            for j in range(n):
                x[j] += c * K[i, j]
        worst, p, way = FEASIBLE, -1, 0
        for k in range(n + m):
            if side[k] == 0 and k != barred and (k >= n or not lower[k] <= x[k] <= upper[k]):
                miss, towards = _miss(x, lower, upper, G, G_lower, G_upper, k)
                if miss > worst:
                    worst, p, way = miss, k, towards
        if p < 0:
            _look_again(side, left)
            return SOLVED
        barred, newest, gained, out = -1, p, 0.0, 0
        while True:
            _image(K, G, p, d)
            if _is_independent(d, q):
                break
            step, out, size = _exchange(R, q, equal, d, r, way, side, active, multiplier)
            if out < 0:
                if worst > FEASIBLE * size:
                    return INFEASIBLE
                break
            for i in range(q):
                multiplier[i] -= way * step * r[i]
            gained += way * step
            side[active[out]] = 0
            _remove(K, R, q, out, active, b, multiplier)
            q -= 1
            left = _look_again(side, left)
        if out < 0:
            side[p] = _LEFT
            left += 1
            continue
        left = _look_again(side, left)
        _append(K, R, q, d, w)
        if p < n:
            b[q] = upper[p] if way > 0 else lower[p]
        else:
            b[q] = G_upper[p - n] if way > 0 else G_lower[p - n]
        active[q], multiplier[q], side[p] = p, gained, way
        q += 1
    return LIMIT
