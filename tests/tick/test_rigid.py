"""Exponential and logarithm of small and large motions, against the matrix functions of SciPy."""

import numpy as np
import pytest
from scipy.linalg import expm, logm

from surgsim.spatial import skew
from surgsim.tick.rigid import exponential, logarithm

ANGLES = [0.0, 1e-9, 1e-5, 3e-3, 9.9e-3, 1.01e-2, 0.1, 1.0, 3.0]


def twist_of(angle, seed=0):
    rng = np.random.default_rng(seed)
    v, w = rng.normal(size=3), rng.normal(size=3)
    return v, angle * w / np.linalg.norm(w)


def matrix_of(v, w):
    X = np.zeros((4, 4))
    X[:3, :3], X[:3, 3] = skew(w), v
    return X


def motion_of(v, w):
    p, R = np.empty(3), np.empty((3, 3))
    exponential(v, w, p, R)
    return p, R


@pytest.mark.parametrize("angle", ANGLES)
def test_the_exponential_is_that_of_the_matrix(angle):
    v, w = twist_of(angle)
    p, R = motion_of(v, w)
    T = expm(matrix_of(v, w))
    np.testing.assert_allclose(R, T[:3, :3], rtol=0.0, atol=3e-15)
    np.testing.assert_allclose(p, T[:3, 3], rtol=0.0, atol=3e-14)


@pytest.mark.parametrize("angle", [0.1, 1.0, 3.0])
def test_the_logarithm_is_that_of_the_matrix(angle):
    T = expm(matrix_of(*twist_of(angle)))
    found = np.empty(3), np.empty(3)
    logarithm(T[:3, 3].copy(), T[:3, :3].copy(), *found)
    np.testing.assert_allclose(matrix_of(*found), logm(T).real, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("angle", ANGLES)
def test_the_logarithm_undoes_the_exponential(angle):
    v, w = twist_of(angle, seed=1)
    back = np.empty(3), np.empty(3)
    logarithm(*motion_of(v, w), *back)
    np.testing.assert_allclose(back, (v, w), rtol=1e-9, atol=1e-14)
