"""Dense quadratic programs: daqp natively and warm, or any back end of qpsolvers by name."""

import warnings
from typing import Any

import daqp
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_EQUALITY, _INEQUALITY = 5, 0


class DenseQp:
    """min 1/2 x^T H x + f^T x  subject to  lower <= x <= upper,  G_lower <= G x <= G_upper.

    Rows with equal bounds are equalities. With the `daqp` back end the workspace and the active set of the
    last solve are reused.

    Args:
        backend: `daqp`, or the name of another solver that qpsolvers knows here.
    """

    def __init__(self, backend: str = "daqp") -> None:
        self._backend = backend
        self._model: Any = None
        self._shape: tuple[int, ...] = ()
        self._sense = np.zeros(0, dtype=np.int32)

    def solve(
        self, H: Array, f: Array, lower: Array, upper: Array, G: Array, G_lower: Array, G_upper: Array
    ) -> Array | None:
        """The minimiser, or None if there is none within the back end's limits."""
        if (lower > upper).any() or (G_lower > G_upper).any():
            return None
        if self._backend == "daqp":
            return self._solve_daqp(H, f, lower, upper, G, G_lower, G_upper)
        return _solve_with(self._backend, H, f, lower, upper, G, G_lower, G_upper)

    def _solve_daqp(
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
