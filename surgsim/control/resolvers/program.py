"""A resolver's quadratic program at a tick: solved in the loop, or by another solver in Python."""

from collections.abc import Callable

import numpy as np

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.control.qp import SHIPPED, DenseQp
from surgsim.errors import unknown_name
from surgsim.packages import PACKAGES, installed, lacking
from surgsim.tick.arrays import Resolved, Seen
from surgsim.tick.quadratic_program import SOLVED, solve

Program = tuple[Array, Array, Array, Array, Array, Array, Array]
"""H, f, lower, upper, G, G_lower, G_upper, see `surgsim.tick.quadratic_program.solve`."""
Solver = Callable[[Program], Array | None]
OWN = "active_set"
NAMES = ("H", "f", "lower", "upper", "G", "G_lower", "G_upper")


def check_solver(name: str) -> str:
    """`name`, if there is such a solver here.

    Raises:
        ValueError: If there is not.
    """
    if name in SHIPPED:
        return name
    if line := lacking(f"the QP solver '{name}' needs", "qpsolvers", otherwise=", ".join(_here())):
        raise ValueError(line)
    import qpsolvers  # half a second, and only the other solvers need it

    known = sorted({*SHIPPED, *qpsolvers.available_solvers})
    if name not in known:
        raise ValueError(unknown_name(name, "QP solver installed here", known))
    return name


def _here() -> list[str]:
    """The shipped solvers whose package is installed."""
    return [name for name in SHIPPED if name not in PACKAGES or installed(name)]


def examined(program: Program) -> dict[str, Array]:
    """The program's arrays by name, for the person who looks into why it has no answer."""
    return dict(zip(NAMES, program, strict=True))


@compiled
def solve_warm(program: Program, sides: Array, x: Array) -> bool:
    """Fill `x` with the minimiser; False if there is none.

    Args:
        program: The program.
        sides: Which bounds were active at the last solution, one number for each variable and row, zeros at
            first; the same of this one afterwards. As they were where there is no answer.
        x: Filled (n,).
    """
    H, f, lower, upper, G, G_lower, G_upper = program
    n = f.size
    side = np.empty(sides.size, np.int64)
    for i in range(sides.size):
        side[i] = int(sides[i])
    work, active = np.empty((2 * n + 7, n + 1)), np.empty(n + 1, np.int64)
    if solve(H, f, lower, upper, G, G_lower, G_upper, side, x, work, active) != SOLVED:
        return False
    for i in range(sides.size):
        sides[i] = side[i]
    return True


class SolvedInPython:
    """A resolver's kernel whose program goes to another solver, which keeps its own start for the next one.

    Args:
        law: status = law(solver, gains, seen, memory, out): the resolver's kernel, but for the solver.
        solver: Name of the solver, see `DenseQp`.
    """

    def __init__(self, law: Callable[[Solver, Array, Seen, Array, Resolved], int], solver: str) -> None:
        self._law, self._name = law, solver
        self._qp = DenseQp(solver)

    def __call__(self, gains: Array, seen: Seen, memory: Array, out: Resolved) -> int:
        """One tick. The solver forgets what it knows at the first one."""
        if seen.first:
            self._qp = DenseQp(self._name)
        return self._law(lambda program: self._qp.solve(*program), gains, seen, memory, out)
