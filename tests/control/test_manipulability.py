"""Manipulability and its gradient against finite differences and the paper's equations."""

import numpy as np
import pytest

from surgsim.control.manipulability import (
    diamond,
    jacobian_gradient,
    log_manipulability_gradient,
    manipulabilities,
    manipulability,
)
from surgsim.tick.arrays import Model, new

STEP = 1e-6
seeds = pytest.mark.parametrize("seed", range(5))


@pytest.fixture
def q(random_q, seed):
    return random_q(np.random.default_rng(seed))


def _difference(f, q):
    """Central differences of `f` along each joint, stacked first."""
    return np.array([(f(q + step) - f(q - step)) / (2 * STEP) for step in STEP * np.eye(7)])


def _assert_jacobian_gradient(arm, q, H):
    np.testing.assert_allclose(H, _difference(lambda x: arm.kinematics(x).Jv_WT, q), atol=1e-8)


def _vec(matrix):
    return matrix.ravel(order="F")


@seeds
def test_jacobian_gradient_is_the_derivative_of_the_jacobian(arm, q):
    kin = arm.kinematics(q)
    _assert_jacobian_gradient(arm, q, jacobian_gradient(kin.Jv_WT, kin.z_W))


@pytest.mark.parametrize("seed", [0])
@pytest.mark.parametrize("place", [(0, 0, 1), (3, 2, 3), (5, 1, 2)])
def test_the_check_above_catches_one_wrong_entry(arm, q, place):
    kin = arm.kinematics(q)
    H = jacobian_gradient(kin.Jv_WT, kin.z_W)
    H[place] += 1e-6
    with pytest.raises(AssertionError, match="Not equal"):
        _assert_jacobian_gradient(arm, q, H)


@seeds
def test_gradient_of_log_manipulability(arm, q):
    kin = arm.kinematics(q)

    def log_mu(x):
        return 0.5 * np.log(np.linalg.det(arm.kinematics(x).Jv_WT @ arm.kinematics(x).Jv_WT.T))

    gradient = log_manipulability_gradient(kin.Jv_WT, kin.z_W)
    np.testing.assert_allclose(gradient, _difference(log_mu, q), atol=1e-7)
    assert np.abs(gradient).max() > 0.01


@seeds
def test_diamond_is_eq_18_and_times_psi_the_gradient(arm, q):
    kin = arm.kinematics(q)
    J, H = kin.Jv_WT, jacobian_gradient(kin.Jv_WT, kin.z_W)
    literal = np.array([_vec(h.T) for h in H]) @ np.kron(np.eye(3), J.T)
    np.testing.assert_allclose(diamond(J, H), literal, atol=1e-14)
    psi = _vec(np.linalg.inv(J @ J.T))
    np.testing.assert_allclose(literal @ psi, log_manipulability_gradient(J, kin.z_W), atol=1e-10)


@seeds
def test_manipulability_is_the_product_of_the_ellipsoid_s_axes(arm, q):
    kin = arm.kinematics(q)
    for J in (kin.Jv_WT, np.vstack([kin.Jv_WT, kin.Jw_WT])):
        axes = np.sqrt(np.linalg.eigvalsh(J @ J.T))
        assert manipulability(J) == pytest.approx(np.prod(axes), rel=1e-9)


def test_manipulability_is_zero_when_a_direction_is_lost(arm):
    J = arm.kinematics(np.zeros(7)).Jv_WT  # standing straight up: no vertical motion
    assert manipulability(J) == pytest.approx(0.0, abs=1e-9)
    with pytest.raises(np.linalg.LinAlgError):
        log_manipulability_gradient(J, arm.kinematics(np.zeros(7)).z_W)


def test_both_measures_of_a_record_are_numpy_s_and_nan_where_the_state_is_lost(arm, random_q):
    record = new(Model, 7)
    arm.point(record)
    for seed in range(50):
        q = random_q(np.random.default_rng(seed))
        translational, whole = manipulabilities(record, q)
        kin = arm.kinematics(q)
        assert translational == pytest.approx(manipulability(kin.Jv_WT), rel=1e-12)
        assert whole == pytest.approx(manipulability(np.vstack([kin.Jv_WT, kin.Jw_WT])), rel=1e-12)
        assert manipulabilities.py_func(record, q) == (translational, whole)
    q[4] = np.nan
    assert np.isnan(manipulabilities(record, q)).all()
