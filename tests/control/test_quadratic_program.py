"""The loop's own solver on ten kinds of random programs: optimality conditions, other solvers.

Quick tests take a sample of each kind, slow ones 1,000 of each. The conditions are checked by themselves:
every row kept, and the gradient a combination of active rows with multipliers of the right sign.
"""

from itertools import islice

import numpy as np
import pytest
import qpsolvers
from quadratic_programs import KINDS, Program, feasible, generic, stationarity, stream, violation

from surgsim.control.qp import DenseQp
from surgsim.tick.quadratic_program import INFEASIBLE, NONCONVEX, SOLVED, solve, workspace

KEPT = 1e-9
"""By how much a row may be missed, relative to its length and bound."""
STATIONARY = {"near-dependent equalities": 1e-6}
"""What may be left of the gradient, relative to its linear term; 1e-10 for the other kinds."""
ALIKE = 1e-6
"""How far two answers may be apart in the metric of H, relative to the unconstrained minimiser."""
ILL = ("near-dependent equalities",)
OTHERS = {
    name: share
    for name, share in {"daqp": 1.0, "osqp": 0.4, "clarabel": 0.4, "piqp": 0.4}.items()
    if name in qpsolvers.available_solvers
}
"""Installed solvers, and the least share of a kind's programs that each answers within `MET`.

OSQP gives up after 100,000 iterations, and its tolerance is absolute: mixed scales leave it short of `MET`.
"""
MET = 1e-7
counts = pytest.mark.parametrize("count", [40, pytest.param(1000, marks=pytest.mark.slow)])
kinds = pytest.mark.parametrize("kind", [*KINDS, "drifting"])


@counts
@kinds
def test_an_answer_meets_the_optimality_conditions_and_none_means_infeasible(kind, count):
    solver, told = DenseQp("active_set"), {True: 0, False: 0}
    for program in islice(stream(kind, 0), count):
        x = solver.solve(*program.arrays)
        if kind == "semidefinite":
            assert x is None
            continue
        assert (x is not None) == program.feasible
        told[program.feasible] += 1
        if x is not None:
            assert violation(program, x) <= KEPT
            assert stationarity(program, x) <= STATIONARY.get(kind, 1e-10)
    assert kind != "infeasible" or told[False]
    assert kind in ("infeasible", "semidefinite") or told[True]


def _apart(program, x, y):
    free = np.linalg.solve(program.H, program.f)
    return np.sqrt((x - y) @ program.H @ (x - y) / (program.f @ free))


@counts
@pytest.mark.parametrize("name", OTHERS)
@pytest.mark.parametrize("kind", [kind for kind in [*KINDS, "drifting"] if kind != "semidefinite"])
def test_other_solvers_give_the_same_answer_wherever_theirs_is_good(kind, name, count):
    """Where two part, the other has no answer, or one that misses a row."""
    solver, solved, compared = DenseQp("active_set"), 0, 0
    for program in islice(stream(kind, 1), count):
        x, y = solver.solve(*program.arrays), DenseQp(name).solve(*program.arrays)
        met = y is not None and violation(program, y) <= MET
        if x is None:
            assert not met
            continue
        solved += 1
        compared += met
        if met and kind not in ILL:
            assert _apart(program, x, y) <= ALIKE
    assert compared >= OTHERS[name] * solved or kind in ILL


@pytest.mark.parametrize("seed", range(20))
def test_the_conditions_tell_a_point_that_is_not_optimal(seed):
    program, inside = generic(np.random.default_rng(seed))
    x = DenseQp("active_set").solve(*program.arrays)
    assert violation(program, inside) < 1e-14
    assert stationarity(program, inside) > 1e-6
    assert feasible(program)
    worst = np.argmax(np.abs(program.f))
    for step in (-1e-3, 1e-3):
        moved = x + step * np.eye(len(x))[worst]
        assert max(violation(program, moved), stationarity(program, moved)) > 1e-6


def test_a_wrong_guess_of_the_active_set_gives_the_same_answer():
    rng = np.random.default_rng(0)
    for program in islice(stream("vertices", 2), 200):
        n, rows = len(program.f), len(program.low)
        work, active, side = workspace(n, rows)
        answers = []
        for guess in (side, rng.integers(-1, 3, n + rows)):
            x = np.empty(n)
            assert solve(*program.arrays, guess, x, work, active) == SOLVED
            answers.append(x)
        assert _apart(program, *answers) < 1e-9


def test_a_right_guess_needs_one_iteration():
    for program in islice(stream("generic", 3), 100):
        n, rows = len(program.f), len(program.low)
        work, active, side = workspace(n, rows)
        x = np.empty(n)
        assert solve(*program.arrays, side, x, work, active) == SOLVED
        assert solve(*program.arrays, side, x, work, active) == SOLVED
        assert active[n] == 1


def test_compiled_and_plain_give_the_same_bits():
    for program in islice(stream("duplicates", 4), 10):
        n, rows = len(program.f), len(program.low)
        answers = []
        for form in (solve, solve.py_func):
            work, active, side = workspace(n, rows)
            x = np.empty(n)
            assert form(*program.arrays, side, x, work, active) == SOLVED
            answers.append(x)
        np.testing.assert_array_equal(*answers)


def test_each_refusal_has_its_status():
    for kind, status in (("infeasible", INFEASIBLE), ("semidefinite", NONCONVEX)):
        for program in islice(stream(kind, 5), 100):
            n, rows = len(program.f), len(program.low)
            work, active, side = workspace(n, rows)
            assert solve(*program.arrays, side, np.empty(n), work, active) == status
    crossed = Program(
        np.eye(2), np.zeros(2), np.ones(2), -np.ones(2), np.zeros((0, 2)), np.zeros(0), np.zeros(0)
    )
    work, active, side = workspace(2, 0)
    assert solve(*crossed.arrays, side, np.empty(2), work, active) == INFEASIBLE
