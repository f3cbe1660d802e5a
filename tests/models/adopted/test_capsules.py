"""Capsules hold what they are put around, and not much else."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surgsim.models.adopted.capsules import Capsule, capsule_around, capsules_around
from surgsim.models.adopted.surface import Surface, coarser, hull, thinned
from surgsim.spatial import segment_distance_squared


def _on_capsule(rng, ends, radius, count=2000):
    """Points on the surface of a capsule, by rejection from a dense shell."""
    axis = ends[1] - ends[0]
    along = rng.uniform(-0.5, 1.5, count)[:, None] * axis + ends[0]
    ways = rng.normal(size=(count, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    share = np.clip((along - ends[0]) @ axis / (axis @ axis), 0.0, 1.0)[:, None]
    return ends[0] + share * axis + radius * ways


@given(st.integers(0, 10_000))
@settings(max_examples=40, deadline=None)
def test_every_point_is_inside(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(300, 3)) @ np.diag(rng.uniform(0.01, 0.2, 3)) + rng.normal(size=3)
    for splits in (0, 2):
        depth = np.max([c.depth(points) for c in capsules_around(points, splits)], axis=0)
        assert depth.min() > -1e-9


@pytest.mark.parametrize("seed", range(5))
def test_a_capsule_is_found_again(seed):
    rng = np.random.default_rng(seed)
    ends, radius = rng.normal(size=(2, 3)) * 0.2, 0.05
    found = capsule_around(_on_capsule(rng, ends, radius))
    exact = Capsule(ends=ends, radius=radius)
    assert exact.volume * 0.97 < found.volume < exact.volume * 1.05


def test_an_elbow_gets_two_capsules_and_a_rod_one():
    rng = np.random.default_rng(0)
    upper = _on_capsule(rng, np.array([[0.0, 0, 0], [0, 0, 0.3]]), 0.05)
    fore = _on_capsule(rng, np.array([[0.0, 0, 0.3], [0.3, 0, 0.3]]), 0.05)
    assert len(capsules_around(upper)) == 1
    elbow = np.concatenate([upper, fore])
    found = capsules_around(elbow)
    assert len(found) >= 2
    assert sum(c.volume for c in found) < 0.6 * capsule_around(elbow).volume


@given(st.integers(0, 10_000))
@settings(max_examples=60, deadline=None)
def test_the_distance_of_segments_is_the_least_of_many(seed):
    rng = np.random.default_rng(seed)
    one, other = rng.normal(size=(2, 2, 3))
    if seed % 3 == 0:
        other = other[[0, 0]]
    if seed % 3 == 1:
        other = one + rng.normal(size=3)  # parallel
    s = np.linspace(0.0, 1.0, 201)[:, None]
    a, b = one[0] + s * (one[1] - one[0]), other[0] + s * (other[1] - other[0])
    least = np.min(np.linalg.norm(a[:, None] - b[None], axis=2))
    found = np.sqrt(segment_distance_squared(*one, *other))
    assert found <= least + 1e-12
    assert found >= least - 0.03


def test_points_of_a_surface_leave_no_gap():
    points = np.array([[0.0, 0, 0], [0.3, 0, 0], [0.1, 0.25, 0]])
    surface = Surface(points=points, faces=np.array([[0, 1, 2]]), rgba=np.ones(4))
    samples = surface.sampled(0.02)
    rng = np.random.default_rng(0)
    for _ in range(300):
        w = rng.dirichlet(np.ones(3))
        assert np.min(np.linalg.norm(samples - w @ points, axis=1)) < 0.02
    assert len(thinned(samples, 0.05)) < len(samples) / 3


def test_a_fine_surface_is_drawn_coarser_in_the_same_place():
    rng = np.random.default_rng(0)
    ball = rng.normal(size=(4000, 3))
    ball *= 0.1 / np.linalg.norm(ball, axis=1, keepdims=True)
    surface = Surface(points=ball, faces=hull(ball), rgba=np.ones(4))
    assert len(surface.faces) > 4000
    found = coarser(surface, 1000)
    assert 200 < len(found.faces) <= 1000
    radius = np.linalg.norm(found.points[np.unique(found.faces)], axis=1)
    np.testing.assert_allclose(radius, 0.1, atol=1e-12)
