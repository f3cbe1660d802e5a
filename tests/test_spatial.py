import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from surgsim.spatial import (
    cross,
    nearest_on_line,
    plane_axes,
    segment_distance_squared,
    shaft_distance,
    skew,
    unit,
)

vectors = st.lists(st.floats(-10, 10), min_size=3, max_size=3).map(np.array)


@given(vectors, vectors)
def test_cross_and_skew(a, b):
    np.testing.assert_allclose(cross(a, b), np.cross(a, b), atol=1e-12)
    np.testing.assert_allclose(skew(a) @ b, np.cross(a, b), atol=1e-12)


def test_unit():
    np.testing.assert_allclose(unit(np.array([3.0, 0.0, -4.0])), [0.6, 0.0, -0.8])


@pytest.mark.parametrize("bad", [(0, 0, 0), (np.nan, 0, 1), (np.inf, 0, 0)])
def test_a_direction_must_be_finite_and_not_zero(bad):
    with pytest.raises(ValueError, match="finite non-zero"):
        unit(np.array(bad, dtype=float))


def test_plane_axes_are_right_handed_with_z_along_the_normal():
    normal, direction = np.array([0.3, -2.0, 1.0]), np.array([1.0, 1.0, 0.2])
    R = np.column_stack(plane_axes(normal, direction))
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)
    np.testing.assert_allclose(R[:, 2], normal / np.linalg.norm(normal))
    assert R[:, 0] @ direction > 0
    assert R[:, 1] @ direction == pytest.approx(0.0, abs=1e-12)


def test_plane_axes_refuse_parallel_vectors():
    with pytest.raises(ValueError, match="parallel"):
        plane_axes(np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -5.0]))


def test_shaft_distance_is_the_distance_from_the_infinite_line():
    tip, wrist = np.array([0.0, 0.0, 0.0]), np.array([0.0, 0.0, 2.0])
    for z in (-3.0, 0.5, 9.0):
        assert shaft_distance(np.array([3.0, 4.0, z]), tip, wrist) == pytest.approx(5.0)


def test_the_nearest_point_of_a_line_is_that_of_least_squares():
    """min |b + t (b - a) - p| over t, by the normal equations of each line."""
    p, a, b = np.random.default_rng(3).normal(size=(3, 20, 3))
    found = nearest_on_line(p, a, b)
    for i in range(20):
        t = np.linalg.lstsq((b[i] - a[i])[:, None], p[i] - b[i], rcond=None)[0]
        np.testing.assert_allclose(found[i], b[i] + t * (b[i] - a[i]), atol=1e-12)
        assert np.linalg.norm(found[i] - p[i]) == pytest.approx(shaft_distance(p[i], b[i], a[i]))


@pytest.mark.parametrize("turned", [False, True])
def test_a_point_is_as_far_from_a_segment_as_from_its_nearest_point(turned):
    point, start, end = np.array([0.5, 0.3, 0.0]), np.zeros(3), np.array([1.0, 0.0, 0.0])
    pair = ((point, point), (start, end))
    (a0, a1), (b0, b1) = pair[::-1] if turned else pair
    assert segment_distance_squared(a0, a1, b0, b1) == pytest.approx(0.09)
