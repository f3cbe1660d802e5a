"""Random quadratic programs of ten kinds and mixed scales, and the conditions that tell an optimum."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog, nnls

N, ROWS = 7, 5


@dataclass
class Program:
    """H, f, lower, upper, G, low, high as `DenseQp.solve` takes them; `feasible` where that is known."""

    H: np.ndarray
    f: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    G: np.ndarray
    low: np.ndarray
    high: np.ndarray
    feasible: bool = True

    @property
    def arrays(self):
        return self.H, self.f, self.lower, self.upper, self.G, self.low, self.high

    def copies(self):
        return Program(*(array.copy() for array in self.arrays), feasible=self.feasible)


def generic(rng) -> tuple[Program, np.ndarray]:
    """Weights, rows and demands over four decades each, about a point inside, which is given too."""
    weights = 10.0 ** rng.uniform(-2.0, 2.0, N)
    A = rng.standard_normal((N, N)) / np.sqrt(N)
    H = np.sqrt(weights)[:, None] * (A @ A.T + 0.1 * np.eye(N)) * np.sqrt(weights)
    f = 10.0 ** rng.uniform(-1.0, 3.0) * rng.standard_normal(N)
    inside = rng.uniform(-0.5, 0.5, N)
    lower, upper = inside - rng.uniform(0.05, 1.0, N), inside + rng.uniform(0.05, 1.0, N)
    lower[rng.random(N) < 0.1], upper[rng.random(N) < 0.1] = -np.inf, np.inf
    G = rng.standard_normal((ROWS, N)) * 10.0 ** rng.uniform(-2.0, 2.0, (ROWS, 1))
    length = np.linalg.norm(G, axis=1)
    low, high = (G @ inside + s * length * rng.uniform(0.02, 1.0, ROWS) for s in (-1.0, 1.0))
    low[0] = high[0] = G[0] @ inside
    low[3], high[4] = -np.inf, np.inf
    return Program(H, f, lower, upper, G, low, high), inside


def _with_rows(p, G, low, high):
    p.G, p.low, p.high = np.vstack([p.G, G]), np.r_[p.low, low], np.r_[p.high, high]
    return p


def plain(rng):
    return generic(rng)[0]


def opposed(rng):
    """An upper bound of a row as the lower bound of its negative, further scaled."""
    p, _ = generic(rng)
    s = 10.0 ** rng.uniform(-1.0, 1.0)
    return _with_rows(p, -s * p.G[1:3], -s * p.high[1:3], -s * p.low[1:3])


def duplicates(rng):
    """The same rows again, equalities among them."""
    p, _ = generic(rng)
    again = rng.integers(0, ROWS, 4)
    return _with_rows(p, p.G[again], p.low[again], p.high[again])


def zero_width(rng):
    """Bounds that leave two variables and a row no choice."""
    p, inside = generic(rng)
    for k in rng.choice(N, 2, replace=False):
        p.lower[k] = p.upper[k] = inside[k]
    p.low[1] = p.high[1] = p.G[1] @ inside
    return p


def vertex(rng):
    """More active rows than variables meet in one point, which is far down the objective's slope."""
    p, inside = generic(rng)
    G = rng.standard_normal((2 * N, N))
    p.f = p.f - 10.0 * np.abs(p.f).max() * G.sum(axis=0)
    return _with_rows(p, G, np.full(2 * N, -np.inf), G @ inside)


def slab(rng):
    """Rows between bounds that are nearly equal."""
    p, inside = generic(rng)
    width = 10.0 ** rng.uniform(-7.0, -5.0, 2)
    p.low[1:3] = p.G[1:3] @ inside - width
    p.high[1:3] = p.G[1:3] @ inside + width
    return p


def near_dependent(rng):
    """Two equalities that differ by little: their combination is as small as 1e-6 of them."""
    p, inside = generic(rng)
    row = p.G[0] + 10.0 ** rng.uniform(-6.0, -4.0) * np.linalg.norm(p.G[0]) * rng.standard_normal(N)
    return _with_rows(p, row[None], [row @ inside], [row @ inside])


def infeasible(rng):
    """A combination of rows and bounds that cannot be met, by a margin from 1e-5 to 1."""
    p, inside = generic(rng)
    p.lower[:], p.upper[:] = inside - 0.5, inside + 0.5
    row = rng.standard_normal(N)
    out = row @ inside + 0.5 * np.abs(row).sum() + 10.0 ** rng.uniform(-5.0, 0.0) * np.linalg.norm(row)
    p.feasible = False
    return _with_rows(p, row[None], [out], [np.inf])


def semidefinite(rng):
    """An objective that is flat along a direction."""
    p, _ = generic(rng)
    A = rng.standard_normal((N, N - 2))
    p.H = A @ A.T
    return p


def drifting(rng) -> Iterator[Program]:
    """Programs that change a little from one to the next, as a resolver's do."""
    p, _ = generic(rng)
    while True:
        p = p.copies()
        p.f = p.f + 0.05 * np.abs(p.f).max() * rng.standard_normal(N)
        p.G = p.G * (1.0 + 0.03 * rng.standard_normal(p.G.shape))
        p.feasible = feasible(p)
        yield p
        if not p.feasible:
            p, _ = generic(rng)


def stream(kind, seed) -> Iterator[Program]:
    """Programs of a kind without end."""
    rng = np.random.default_rng(seed)
    if kind == "drifting":
        yield from drifting(rng)
    while True:
        yield KINDS[kind](rng)


KINDS: dict[str, Callable[[np.random.Generator], Program]] = {
    "generic": plain,
    "opposed rows": opposed,
    "duplicates": duplicates,
    "zero width": zero_width,
    "vertices": vertex,
    "thin slabs": slab,
    "near-dependent equalities": near_dependent,
    "infeasible": infeasible,
    "semidefinite": semidefinite,
}


def rows_of(p):
    """All rows, variables first, and their bounds."""
    return np.vstack([np.eye(len(p.f)), p.G]), np.r_[p.lower, p.low], np.r_[p.upper, p.high]


def feasible(p) -> bool:
    """Whether a linear program finds a point."""
    rows, a, b = rows_of(p)
    size = np.linalg.norm(rows, axis=1)
    rows, a, b = rows / size[:, None], a / size, b / size
    up, down = np.isfinite(b), np.isfinite(a)
    found = linprog(
        np.zeros(len(p.f)),
        np.vstack([rows[up], -rows[down]]),
        np.r_[b[up], -a[down]],
        bounds=(None, None),
        method="highs",
    )
    return bool(found.status == 0)


def violation(p, x) -> float:
    """By how much the worst row is missed, relative to its length and bound."""
    rows, a, b = rows_of(p)
    size, value = np.linalg.norm(rows, axis=1), rows @ x
    up, down = np.isfinite(b), np.isfinite(a)
    over = (value - b)[up] / (size + np.abs(b))[up]
    under = (a - value)[down] / (size + np.abs(a))[down]
    return float(max(over.max(initial=0.0), under.max(initial=0.0)))


def stationarity(p, x, near=1e-7) -> float:
    """What active rows, with multipliers of the right sign, leave of the gradient, relative to its terms."""
    rows, a, b = rows_of(p)
    size = np.linalg.norm(rows, axis=1)
    value = rows @ x
    at_low = value - a <= near * (size + np.abs(a))
    at_high = b - value <= near * (size + np.abs(b))
    gradient = p.H @ x + p.f
    scale = np.sqrt(np.diag(p.H))  # as if every variable had the same weight
    active = np.vstack([rows[at_low], -rows[at_high]]) / scale
    gradient, terms = gradient / scale, np.linalg.norm(p.f / scale)
    if not len(active):
        return float(np.linalg.norm(gradient) / terms)
    length = np.linalg.norm(active, axis=1)
    return float(nnls((active / length[:, None]).T, gradient, maxiter=1000)[1] / terms)
