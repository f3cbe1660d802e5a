"""Null-space tools against explicit pseudo-inverses and projectors."""

import numpy as np
import pytest

from surgsim.control.null_space import least_velocity

rows = pytest.mark.parametrize("rows", [1, 3, 5, 7])


def _projector(J):
    return np.eye(7) - np.linalg.pinv(J) @ J


@rows
def test_least_velocity_is_pinv_and_projector(rows):
    rng = np.random.default_rng(rows)
    J, v, q0 = rng.standard_normal((rows, 7)), rng.standard_normal(rows), rng.standard_normal(7)
    np.testing.assert_allclose(least_velocity(J, v), np.linalg.pinv(J) @ v, atol=1e-10)
    expected = np.linalg.pinv(J) @ v + _projector(J) @ q0
    np.testing.assert_allclose(least_velocity(J, v, q0), expected, atol=1e-10)


@rows
def test_projection_is_the_projector_of_the_rows(rows):
    rng = np.random.default_rng(rows)
    J, q0 = rng.standard_normal((rows, 7)), rng.standard_normal(7)
    np.testing.assert_allclose(least_velocity(J, np.zeros(len(J)), q0), _projector(J) @ q0, atol=1e-10)
    np.testing.assert_allclose(J @ least_velocity(J, np.zeros(len(J)), q0), 0.0, atol=1e-10)


def test_without_a_wish_the_answer_is_the_shortest_of_all_solutions():
    rng = np.random.default_rng(0)
    J, v = rng.standard_normal((5, 7)), rng.standard_normal(5)
    shortest = np.linalg.norm(least_velocity(J, v))
    for _ in range(20):
        other = least_velocity(J, v, rng.standard_normal(7))
        np.testing.assert_allclose(J @ other, v, atol=1e-10)
        assert np.linalg.norm(other) > shortest


def test_rows_that_have_lost_rank_are_no_answer():
    with pytest.raises(np.linalg.LinAlgError):
        least_velocity(np.zeros((3, 7)), np.ones(3))
