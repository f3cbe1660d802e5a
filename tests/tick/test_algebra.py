"""Small dense algebra of the kernels, against numpy and scipy."""

import numpy as np
import pytest
import scipy.linalg

from surgsim.tick.algebra import diagonalise, null_space

SHAPES = [(3, 6), (5, 6), (3, 7), (5, 7), (3, 8), (5, 8), (6, 7), (0, 4), (4, 4)]


def _basis(J):
    Z = np.full((J.shape[1] - J.shape[0], J.shape[1]), np.nan)
    null_space(J, Z)
    return Z


@pytest.mark.parametrize(("m", "n"), SHAPES)
def test_the_null_space_is_scipys(m, n):
    J = np.random.default_rng(m + n).normal(size=(m, n))
    Z, expected = _basis(J), scipy.linalg.null_space(J)
    np.testing.assert_allclose(Z @ Z.T, np.eye(n - m), atol=1e-14)
    np.testing.assert_allclose(Z.T @ Z, expected @ expected.T, atol=1e-13)


def test_a_joint_that_moves_nothing_is_a_direction_of_the_null_space():
    """The instrument's roll: its column is zero, and the other directions leave it alone."""
    J = np.random.default_rng(1).normal(size=(5, 7))
    J[:, 6] = 0.0
    Z = _basis(J)
    np.testing.assert_allclose(J @ Z.T, 0.0, atol=1e-14)
    assert sorted(np.abs(Z[:, 6])) == [0.0, 1.0]


@pytest.mark.parametrize("J", [np.zeros((3, 7)), np.ones((3, 7)), np.eye(3, 7), np.eye(7)[4:]])
def test_a_basis_is_orthonormal_whatever_the_rank(J):
    Z = _basis(J)
    np.testing.assert_allclose(Z @ Z.T, np.eye(4), atol=1e-14)
    np.testing.assert_allclose(J @ Z.T, 0.0, atol=1e-14)


@pytest.mark.parametrize("n", range(1, 7))
@pytest.mark.parametrize("scale", [1.0, 1e-9, 1e9])
def test_eigenvalues_are_those_of_lapack(n, scale):
    A = scale * np.random.default_rng(n).normal(size=(n, n))
    A += A.T
    D, V = A.copy(), np.empty((n, n))
    diagonalise(D, V)
    np.testing.assert_allclose(np.sort(np.diag(D)), np.linalg.eigvalsh(A), atol=1e-14 * n * abs(A).max())
    np.testing.assert_allclose(V @ V.T, np.eye(n), atol=1e-14)
    np.testing.assert_allclose(V @ np.diag(np.diag(D)) @ V.T, A, atol=1e-14 * n * abs(A).max())


@pytest.mark.parametrize("A", [np.zeros((3, 3)), np.eye(3), np.diag([1.0, 1e-300, -2.0]), np.ones((4, 4))])
def test_equal_and_zero_eigenvalues_are_no_special_case(A):
    D, V = A.copy(), np.empty(A.shape)
    diagonalise(D, V)
    np.testing.assert_allclose(np.sort(np.diag(D)), np.linalg.eigvalsh(A), atol=1e-15)
    np.testing.assert_allclose(V @ V.T, np.eye(len(A)), atol=1e-15)
