"""Dense quadratic programs in Python, by one of several solvers: ours, daqp, OSQP, others of qpsolvers."""

import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

import daqp
import numpy as np

from surgsim.array import Array
from surgsim.packages import require
from surgsim.tick.quadratic_program import SOLVED, solve, workspace

Solve = Callable[[Array, Array, Array, Array, Array, Array, Array], Array | None]
"""H, f, lower, upper, G, G_lower, G_upper to the minimiser, or None: what a back end is."""

SHIPPED = ("active_set", "daqp", "osqp")
"""Back ends that start from their last answer; they are tested on every scenario that names a QP."""

_EQUALITY, _INEQUALITY = 5, 0


class DenseQp:
    """min 1/2 x^T H x + f^T x  subject to  lower <= x <= upper,  G_lower <= G x <= G_upper.

    H is positive definite; rows with equal bounds are equalities. The shipped ones start from what they know
    of the last solve, so that a run needs a `DenseQp` of its own.

    Args:
        backend: One of `SHIPPED`, or the name of another solver that qpsolvers knows here.
    """

    def __init__(self, backend: str = "active_set") -> None:
        self._solve = _backend(backend)

    def solve(
        self, H: Array, f: Array, lower: Array, upper: Array, G: Array, G_lower: Array, G_upper: Array
    ) -> Array | None:
        """The minimiser, or None if there is none within the back end's limits."""
        if (lower > upper).any() or (G_lower > G_upper).any():
            return None
        return self._solve(H, f, lower, upper, G, G_lower, G_upper)


def check_package(name: str) -> None:
    """Refuse a shipped back end whose package is not installed.

    Raises:
        MissingPackageError: Then.
    """
    if name == "osqp":
        require("the QP solver 'osqp' needs", "osqp")


def _backend(name: str) -> Solve:
    if name == "active_set":
        return _ActiveSet().solve
    if name == "daqp":
        return _Daqp().solve
    if name == "osqp":
        check_package(name)
        from surgsim.control.qp_osqp import Osqp  # a third of a second, and only this back end needs it

        return Osqp().solve
    return partial(_solve_with, name)


class _ActiveSet:
    """The kernel of the loop: the active set of the last solve is its guess."""

    def __init__(self) -> None:
        self._side = np.zeros(0, dtype=np.int64)

    def solve(
        self, H: Array, f: Array, lower: Array, upper: Array, G: Array, G_lower: Array, G_upper: Array
    ) -> Array | None:
        n, rows = G.shape[1], G.shape[0]
        work, active, side = workspace(n, rows)
        if self._side.size == side.size:
            side = self._side
        x = np.empty(n)
        c = np.ascontiguousarray
        low, high, G_low, G_high = c(lower), c(upper), c(G_lower), c(G_upper)
        found = solve(c(H), c(f), low, high, c(G), G_low, G_high, side, x, work, active)
        self._side = side if found == SOLVED else np.zeros(0, dtype=np.int64)
        return x if found == SOLVED else None


class _Daqp:
    """daqp natively: the workspace and the active set of the last solve are reused."""

    def __init__(self) -> None:
        self._model: Any = None
        self._shape: tuple[int, ...] = ()
        self._sense = np.zeros(0, dtype=np.int32)

    def solve(
        self, H: Array, f: Array, lower: Array, upper: Array, G: Array, G_lower: Array, G_upper: Array
    ) -> Array | None:
        low, high = np.concatenate((lower, G_lower)), np.concatenate((upper, G_upper))
        sense = np.where(low == high, _EQUALITY, _INEQUALITY).astype(np.int32)
        if self._model is None or self._shape != G.shape or not np.array_equal(sense, self._sense):
            self._model, self._shape, self._sense = daqp.Model(), G.shape, sense
            flag, _ = self._model.setup(H, f, np.ascontiguousarray(G), high, low, sense)
        else:
            flag = self._model.update(H=H, f=f, A=np.ascontiguousarray(G), bupper=high, blower=low)
        if flag < 0:
            self._model = None
            return None
        x, _, exitflag, _ = self._model.solve()
        if exitflag <= 0:
            self._model = None
            return None
        return np.array(x)


def _solve_with(
    backend: str, H: Array, f: Array, lower: Array, upper: Array, G: Array, G_lower: Array, G_upper: Array
) -> Array | None:
    import qpsolvers  # half a second, and only the other back ends need it

    equal = G_lower == G_upper
    one_sided = [(G[~equal], G_upper[~equal]), (-G[~equal], -G_lower[~equal])]
    rows = np.vstack([a for a, _ in one_sided])
    bound = np.concatenate([b for _, b in one_sided])
    finite = np.isfinite(bound)
    problem = qpsolvers.Problem(
        H,
        f,
        rows[finite] if finite.any() else None,
        bound[finite] if finite.any() else None,
        G[equal] if equal.any() else None,
        G_lower[equal] if equal.any() else None,
        lower,
        upper,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # back ends warn about sparse conversion and about infeasibility
        solution = qpsolvers.solve_problem(problem, solver=backend)
    return np.array(solution.x) if solution.found and solution.x is not None else None
