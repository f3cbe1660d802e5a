"""Dense quadratic programs against other solvers, their optimality conditions, and themselves."""

from dataclasses import dataclass, field

import numpy as np
import pytest
import qpsolvers
from scipy.optimize import linprog, nnls

from surgsim.control.qp import SHIPPED, DenseQp

every_backend = pytest.mark.parametrize("backend", SHIPPED)
seeds = pytest.mark.parametrize("seed", range(12))


@dataclass(frozen=True)
class Program:
    """A random program with a known point inside; equalities, one- and two-sided rows and bounds."""

    seed: int
    n: int = 7
    shift: float = 1.0
    arrays: tuple = field(init=False)

    def __post_init__(self):
        rng = np.random.default_rng(self.seed)
        n, m = self.n, 6
        A = rng.standard_normal((n, n))
        H, f = A @ A.T + 0.1 * np.eye(n), 10.0 * self.shift * rng.standard_normal(n)
        inside = rng.uniform(-0.5, 0.5, n)
        lower, upper = inside - rng.uniform(0.1, 1.0, n), inside + rng.uniform(0.1, 1.0, n)
        lower[0], upper[1] = -np.inf, np.inf
        G = rng.standard_normal((m, n))
        low, high = G @ inside - rng.uniform(0.1, 1.0, m), G @ inside + rng.uniform(0.1, 1.0, m)
        low[0] = high[0] = G[0] @ inside
        low[1] = high[1] = G[1] @ inside
        low[2], high[3] = -np.inf, np.inf
        object.__setattr__(self, "arrays", (H, f, lower, upper, G, low, high))


def assert_optimal(x, H, f, lower, upper, G, low, high, tolerance=1e-7):
    """Feasible, and the gradient is a combination of active rows with multipliers of the right sign."""
    rows, a, b = np.vstack([np.eye(len(x)), G]), np.r_[lower, low], np.r_[upper, high]
    values = rows @ x
    assert (values >= a - tolerance).all()
    assert (values <= b + tolerance).all()
    at_low, at_high = values < a + tolerance, values > b - tolerance
    active = np.vstack([rows[at_low], -rows[at_high]])  # gradient = sum of y_i row_i with y >= 0
    gradient = H @ x + f
    y = nnls(active.T, gradient)[0]
    np.testing.assert_allclose(active.T @ y, gradient, atol=1e-5 * max(1.0, np.abs(gradient).max()))


def test_the_optimality_check_catches_points_that_are_not_optimal():
    arrays = Program(0).arrays
    x = DenseQp().solve(*arrays)
    assert_optimal(x, *arrays)
    for direction in np.eye(7):
        with pytest.raises(AssertionError):
            assert_optimal(x + 1e-4 * direction, *arrays)


@seeds
def test_the_answer_is_the_optimum(seed):
    arrays = Program(seed).arrays
    x = DenseQp().solve(*arrays)
    assert_optimal(x, *arrays)
    free = np.linalg.solve(arrays[0], -arrays[1])
    assert np.linalg.norm(x - free) > 0.1  # the constraints matter


@seeds
def test_osqp_gives_the_same_answer(seed):
    arrays = Program(seed).arrays
    osqp = DenseQp("osqp").solve(*arrays)
    assert_optimal(osqp, *arrays)
    np.testing.assert_allclose(osqp, DenseQp().solve(*arrays), atol=1e-8)


def _weighted(seed):
    """A resolver's program: weights 1 and 2e6, a slack, an equality twice, an empty row, an active limit."""
    rng = np.random.default_rng(seed)
    J, v = rng.standard_normal((3, 7)), np.full(3, 0.05)
    shaft = rng.standard_normal((2, 7))
    H = np.diag([1.0] * 7 + [2e6] * 3)
    wide = np.zeros((3, 3))
    G = np.vstack(
        [
            np.hstack([J, -np.eye(3)]),
            *[np.hstack([shaft, np.zeros((2, 3))])] * 2,
            np.hstack([J, wide]),
            np.zeros(10),
        ]
    )
    low = np.r_[v, np.zeros(4), -0.03 * np.ones(3), -np.inf]
    high = np.r_[v, np.zeros(4), 0.03 * np.ones(3), 7.0]
    box = np.r_[np.full(7, 2.0), np.full(3, np.inf)]
    return H, np.zeros(10), -box, box, G, low, high


@seeds
def test_osqp_copes_with_a_resolver_s_weights_dependent_equalities_and_empty_rows(seed):
    arrays = _weighted(seed)
    x = DenseQp("osqp").solve(*arrays)
    tip = (arrays[4] @ x)[7:10]
    np.testing.assert_allclose(tip, 0.03, atol=1e-8)  # the speed limit is active along every axis
    independent = [*range(5), *range(7, 11)]
    fewer = (*arrays[:4], *(a[independent] for a in arrays[4:]))
    np.testing.assert_allclose(x, DenseQp().solve(*fewer), atol=1e-8)


def test_osqp_where_the_equalities_leave_no_choice():
    H, f, lower, upper, _, _, _ = Program(5, n=7).arrays
    at = np.where(np.isfinite(lower) & np.isfinite(upper), 0.5 * (lower + upper), 0.0)
    at[0], at[1] = upper[0] - 0.1, lower[1] + 0.1
    x = DenseQp("osqp").solve(H, f, lower, upper, np.eye(7), at, at)
    np.testing.assert_allclose(x, at, atol=1e-9)
    beyond = at.copy()
    beyond[2] = upper[2] + 0.1
    assert DenseQp("osqp").solve(H, f, lower, upper, np.eye(7), beyond, beyond) is None


def test_osqp_prints_nothing(capfd):
    solver = DenseQp("osqp")
    for seed in range(6):
        solver.solve(*Program(seed, shift=1e-3).arrays)
    assert capfd.readouterr() == ("", "")


@every_backend
def test_a_shipped_back_end_gives_the_same_bits_again(backend):
    def answers():
        solver = DenseQp(backend)
        return [solver.solve(*Program(seed).arrays) for seed in range(12)]

    np.testing.assert_array_equal(answers(), answers())


@seeds
def test_qpsolvers_back_end_sees_the_same_program(seed):
    """The one-sided form that qpsolvers is given, through its own daqp."""
    arrays = Program(seed).arrays
    np.testing.assert_allclose(DenseQp("qpsolvers-daqp").solve(*arrays), DenseQp().solve(*arrays), atol=1e-6)


@pytest.fixture(autouse=True)
def _daqp_by_another_name(monkeypatch):
    """`DenseQp("daqp")` is native: under this name it goes through qpsolvers."""
    solve = qpsolvers.solve_problem

    def solve_problem(problem, solver, **options):
        return solve(problem, solver={"qpsolvers-daqp": "daqp"}.get(solver, solver), **options)

    monkeypatch.setattr(qpsolvers, "solve_problem", solve_problem)


@every_backend
def test_a_warm_solver_gives_the_answers_of_a_cold_one(backend):
    warm = DenseQp(backend)
    for seed in [*range(12), *range(12)]:
        arrays = Program(seed, shift=1.0 + 0.1 * seed).arrays
        np.testing.assert_allclose(warm.solve(*arrays), DenseQp(backend).solve(*arrays), atol=1e-8)


@every_backend
def test_a_solver_follows_changes_of_size_and_of_which_rows_are_equal(backend):
    solver = DenseQp(backend)
    for n in (7, 10, 7):
        arrays = Program(1, n).arrays
        assert_optimal(solver.solve(*arrays), *arrays)
    solver = DenseQp(backend)
    H, f, lower, upper, G, low, high = Program(1).arrays
    middle = np.where(np.isfinite(low) & np.isfinite(high), 0.5 * (low + high), 0.0)
    for which in ([4], [5], [4, 5], []):
        changed_low, changed_high = low.copy(), high.copy()
        changed_low[which] = changed_high[which] = middle[which]
        arrays = (H, f, lower, upper, G, changed_low, changed_high)
        x = solver.solve(*arrays)
        assert_optimal(x, *arrays)
        np.testing.assert_allclose((G @ x)[which], middle[which], atol=1e-8)


@every_backend
def test_the_inputs_and_earlier_answers_stay_as_they_are(backend):
    solver, arrays = DenseQp(backend), Program(2).arrays
    copies = [array.copy() for array in arrays]
    first = solver.solve(*arrays)
    kept = first.copy()
    solver.solve(*Program(3).arrays)
    np.testing.assert_array_equal(first, kept)
    for array, copy in zip(arrays, copies, strict=True):
        np.testing.assert_array_equal(array, copy)


def _contradict(kind):
    """The arrays of a program made infeasible."""
    arrays = [array.copy() for array in Program(4).arrays]
    _, _, lower, upper, _, low, high = arrays
    lower[0], upper[1] = -1.0, 1.0
    if kind == "a row out of reach":
        low[4], high[4] = -np.inf, -1e3
    elif kind == "equalities out of reach":
        low[:2] = high[:2] = 1e3
    else:
        upper[2] = lower[2] - 1.0
    return arrays


@every_backend
@pytest.mark.parametrize("kind", ["a row out of reach", "equalities out of reach", "crossed bounds"])
def test_a_program_without_a_solution_gives_none_and_spoils_nothing(backend, kind):
    solver, good = DenseQp(backend), Program(4).arrays
    before = solver.solve(*good)
    assert solver.solve(*_contradict(kind)) is None
    np.testing.assert_allclose(solver.solve(*good), before, atol=1e-6)


def test_infeasible_here_means_infeasible_for_a_linear_program_too():
    rng = np.random.default_rng(0)
    counts = {True: 0, False: 0}
    for _ in range(60):
        G, low = rng.standard_normal((5, 4)), rng.uniform(-1.0, 1.0, 5)
        high = low + rng.uniform(0.0, 0.5, 5)
        box = np.full(4, 0.6)
        x = DenseQp().solve(np.eye(4), np.zeros(4), -box, box, G, low, high)
        oracle = linprog(
            np.zeros(4), np.vstack([G, -G]), np.r_[high, -low], bounds=[(-0.6, 0.6)] * 4, method="highs"
        )
        assert (x is not None) == oracle.success
        counts[oracle.success] += 1
    assert min(counts.values()) > 5
