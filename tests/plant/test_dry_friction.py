"""Dry friction of coupled joints: against the quadratic program that it is, and what it may do to energy."""

import numpy as np
import pytest
import qpsolvers

from surgsim.models.arm import ArmModel
from surgsim.models.config import RobotConfig, SceneConfig
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
    assert rub(A, most, friction, v)
    assert friction == pytest.approx(best, abs=1e-6)
    assert v == pytest.approx(free - A @ friction, abs=1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_it_never_puts_energy_in(seed):
    """With M = A^-1, the kinetic energy after is at most that before."""
    rng, A, most, free = _problem(seed + 100)
    M, v, friction = np.linalg.inv(A), free.copy(), rng.uniform(-1.0, 1.0, 7) * most
    assert rub(A, most, friction, v)
    assert v @ M @ v <= free @ M @ free * (1.0 + 1e-12)
    assert (np.abs(friction) <= most).all()


@pytest.mark.parametrize("name", ["lwr4plus", "panda", "fr3", "iiwa14"])
def test_a_light_wrist_on_a_heavy_arm_is_solved_in_one_call(name):
    """As in the drives' substeps, S = M/h + kappa beta/(beta + kappa), from any start."""
    arm = ArmModel(SceneConfig(robot=RobotConfig(name=name, drive="real")))
    drive, h, rng = arm.drive, 1e-4, np.random.default_rng(5)
    beta, kappa = drive.rotor_inertia / h, 0.25 * drive.stiffness * h
    for k in range(150):
        q = rng.uniform(arm.limits.q_min, arm.limits.q_max)
        M = arm.dynamics(q, np.zeros(7)).mass_matrix - np.diag(drive.apparent_inertia)
        A = np.linalg.inv(M / h + np.diag(kappa * beta / (beta + kappa)))
        most = rng.uniform(0.0, 1.0, 7)
        free = A @ rng.normal(size=7) * (0.3, 1.0, 5.0)[k % 3]
        friction, v = rng.uniform(-1.0, 1.0, 7) * most, free.copy()
        assert rub(A, most, friction, v)
        assert v == pytest.approx(free - A @ friction, abs=1e-12 + 1e-9 * np.abs(free).max())
        assert (np.abs(friction) <= most * (1.0 + 1e-8)).all()
        sticks = np.abs(friction) < most * (1.0 - 1e-9)
        assert (np.abs(v[sticks]) < 1e-9 * np.abs(free).max()).all()
        assert (v[~sticks] * friction[~sticks] >= -1e-9 * np.abs(free).max()).all()


def test_without_friction_nothing_changes():
    _, A, _, free = _problem(1)
    v, friction = free.copy(), np.zeros(7)
    rub(A, np.zeros(7), friction, v)
    assert np.array_equal(v, free)
