"""Dense quadratic programs by OSQP, an operator-splitting method that starts from its last answer."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import osqp
from scipy.sparse import csc_matrix, identity

from surgsim.array import Array

_SETTINGS = {
    "verbose": False,
    "scaling": 0,  # the program is handed over well scaled
    "adaptive_rho_interval": 1000,  # iterations, never time: the same program gives the same bits
    "check_termination": 5,
    "eps_abs": 1e-10,
    "eps_rel": 1e-10,
    "eps_prim_inf": 1e-9,
    "eps_dual_inf": 1e-9,
    "max_iter": 100_000,
    "polishing": False,  # it prints to standard output where no row is active
}
_FIRM_RHO = 10.0
"""OSQP's rho for programs that it cannot end with the usual one: their bounds are far from the optimum."""
_TINY = 1e-9
_INFINITE = 1e30


@dataclass(frozen=True, slots=True, kw_only=True)
class _Reduced:
    """min 1/2 |z|^2  subject to  low <= B z <= high,  with  x = x_e + basis z.

    Attributes:
        x_e: Optimum under the equalities alone (n,).
        basis: Columns (n, k) with basis^T H basis = I.
        back: k x n, so that z = back (x - x_e).
        B: Rows of the inequalities at length 1 (m, k).
        scale: What each row was multiplied with (m,).
        low: Lower bounds (m,).
        high: Upper bounds (m,).
    """

    x_e: Array
    basis: Array
    back: Array
    B: Array
    scale: Array
    low: Array
    high: Array


class Osqp:
    """min 1/2 x^T H x + f^T x  subject to bounds and rows, by OSQP after a change of variables.

    Splitting methods are slow where weights differ much: with a resolver's slack weight of 1e6 beside 1,
    OSQP gives up on the program as it stands. So x = x_e + N z, where x_e is the optimum under the equalities
    alone and the columns of N span their null space, with N^T H N = I:

        min 1/2 |z|^2   subject to   low - A x_e <= A N z <= high - A x_e,   rows of A N at length 1

    Equalities then hold to rounding, and OSQP is given the inequalities with a tolerance of 1e-10.

    Source: Stellato et al., OSQP: an operator splitting solver for quadratic programs, 2020.
    """

    def __init__(self) -> None:
        self._model: Any = None
        self._shape: tuple[int, ...] = ()
        self._x = self._multipliers = np.zeros(0)

    def solve(
        self, H: Array, f: Array, lower: Array, upper: Array, G: Array, G_lower: Array, G_upper: Array
    ) -> Array | None:
        """The minimiser (n,), or None if there is none within the solver's limits.

        Raises:
            numpy.linalg.LinAlgError: If H is not positive definite.
        """
        A = np.vstack([np.eye(len(f)), G])
        reduced = _reduce(H, f, A, np.concatenate((lower, G_lower)), np.concatenate((upper, G_upper)))
        x = None if reduced is None else self._solve_reduced(reduced)
        if x is None:
            self._model = None
        return x

    def _solve_reduced(self, p: _Reduced) -> Array | None:
        if p.B.shape[1] == 0:  # the equalities leave no choice
            return p.x_e if (p.low <= _TINY).all() and (p.high >= -_TINY).all() else None
        self._load(p)
        result = self._model.solve(raise_error=False)
        if result.info.status_val == osqp.SolverStatus.OSQP_MAX_ITER_REACHED:
            self._model = None  # from the start, where the last answer leads nowhere
            self._load(p)
            self._model.update_settings(rho=_FIRM_RHO)
            result = self._model.solve(raise_error=False)
            self._model = None
        if result.info.status_val != osqp.SolverStatus.OSQP_SOLVED:
            return None
        self._x = p.x_e + p.basis @ result.x
        self._multipliers = result.y * p.scale
        return self._x.copy()

    def _load(self, p: _Reduced) -> None:
        """Give OSQP the program: a new one, or new numbers and the last answer as the start."""
        values = p.B.ravel(order="F")
        if self._model is None or self._shape != p.B.shape:
            rows = csc_matrix(np.ones_like(p.B))  # every entry is stored, so that any may change
            rows.data = values
            self._model, self._shape = osqp.OSQP(), p.B.shape
            size = p.B.shape[1]
            self._model.setup(identity(size, format="csc"), np.zeros(size), rows, p.low, p.high, **_SETTINGS)
        else:
            self._model.update(Ax=values)
            self._model.update(l=p.low, u=p.high)
            self._model.warm_start(x=p.back @ (self._x - p.x_e), y=self._multipliers / p.scale)


def _reduce(H: Array, f: Array, A: Array, low: Array, high: Array) -> _Reduced | None:
    """The program in z; None if its equalities contradict each other.

    With H = L L^T and w = L^T x, the equalities E L^-T w = b leave w the null space of E L^-T, an orthonormal
    basis of which comes from a singular value decomposition: dependent rows do no harm.
    """
    equal = low == high
    L = np.linalg.cholesky(H)
    to_x = np.linalg.inv(L).T
    free = -to_x.T @ f
    E, b = A[equal] @ to_x, low[equal]
    U, s, Vt = np.linalg.svd(E)
    rank = int(np.count_nonzero(s > _TINY * s.max(initial=0.0)))
    w = free + Vt[:rank].T @ ((U[:, :rank].T @ (b - E @ free)) / s[:rank])
    if (np.abs(E @ w - b) > _TINY * (1.0 + np.abs(b))).any():
        return None
    null = Vt[rank:].T
    x_e, basis = to_x @ w, to_x @ null
    B = A[~equal] @ basis
    length = np.linalg.norm(B, axis=1)
    scale = 1.0 / np.where(length > _TINY, length, 1.0)
    at = A[~equal] @ x_e
    return _Reduced(
        x_e=x_e,
        basis=basis,
        back=null.T @ L.T,
        B=B * scale[:, None],
        scale=scale,
        low=np.maximum((low[~equal] - at) * scale, -_INFINITE),
        high=np.minimum((high[~equal] - at) * scale, _INFINITE),
    )
