"""Dry friction of coupled joints: against the quadratic program that it is, and what it may do to energy."""

import numpy as np
import pytest
import qpsolvers

from surgsim.plant.dry_friction import rub


def _problem(seed, n=7):
    """Joints as different as those of an arm, some without friction."""
    rng = np.random.default_rng(seed)
    L = np.tril(rng.normal(size=(n, n))) * 0.2 + np.diag(rng.uniform(0.03, 1.5, n))
    A = np.linalg.inv(L @ L.T)
    most = rng.uniform(0.0, 1.0, n) * (rng.uniform(size=n) > 0.2)
    return rng, A, most, A @ rng.normal(size=n) * 0.7


@pytest.mark.parametrize("seed", range(20))
def test_it_is_the_least_of_a_quadratic_program(seed):
    """min 1/2 f^T A f - f^T v_free inside the friction; started from anything."""
    rng, A, most, free = _problem(seed)
    best = qpsolvers.solve_qp(A, -free, lb=-most, ub=most, solver="daqp", primal_tol=1e-12, dual_tol=1e-12)
    friction, v = rng.uniform(-1.0, 1.0, 7) * most, free.copy()
    for _ in range(5):  # as in steps that follow each other
        v = free.copy()
        rub(A, most, friction, v)
    assert friction == pytest.approx(best, abs=1e-6)
    assert v == pytest.approx(free - A @ friction, abs=1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_it_never_puts_energy_in(seed):
    """With M = A^-1, the kinetic energy after is at most that before."""
    _, A, most, free = _problem(seed + 100)
    M, v, friction = np.linalg.inv(A), free.copy(), np.zeros(7)
    rub(A, most, friction, v)
    assert v @ M @ v <= free @ M @ free * (1.0 + 1e-12)
    assert (np.abs(friction) <= most).all()


def test_without_friction_nothing_changes():
    _, A, _, free = _problem(1)
    v, friction = free.copy(), np.zeros(7)
    rub(A, np.zeros(7), friction, v)
    assert np.array_equal(v, free)
