"""The self-motion manifold: projection, climbing, the swivel curve, against brute force on it."""

import numpy as np
import pytest
from scipy.linalg import null_space

from surgsim.control.self_motion import SelfMotion, elbow_swivel_rad
from surgsim.spatial import shaft_distance

P_WC = np.array([0.0, 0.55, 0.2])
P_WT = np.array([0.02, 0.55, 0.02])
HOME = np.array([1.5708, -0.5236, 0.0, 1.5708, 0.0, -1.0472, 0.0])
seeds = pytest.mark.parametrize("seed", range(4))


@pytest.fixture(scope="module")
def manifold(arm):
    return SelfMotion(arm)


@pytest.fixture(scope="module")
def here(manifold):
    return manifold.project(HOME, P_WT, P_WC, steps=30)


@pytest.fixture(scope="module")
def curve(manifold, here):
    return manifold.swivel_curve(here.q, P_WT, P_WC)


def _miss(arm, q, p_WT, p_WC):
    """Distances of tip and shaft from where they belong."""
    kin = arm.kinematics(q)
    shaft = 0.0 if p_WC is None else shaft_distance(p_WC, kin.p_WT, kin.p_WT - 0.4 * kin.R_WT[:, 2])
    return np.linalg.norm(kin.p_WT - p_WT), shaft


def _mu(arm, q):
    return np.prod(np.linalg.svd(arm.kinematics(q).Jv_WT, compute_uv=False))


def _constraint_jacobian(arm, q, p_WC, h=1e-6):
    """Rows of tip and shaft by central differences."""

    def residual(x):
        kin = arm.kinematics(x)
        if p_WC is None:
            return kin.p_WT
        return np.r_[kin.p_WT, N @ (np.eye(3) - np.outer(kin.R_WT[:, 2], kin.R_WT[:, 2])) @ (kin.p_WT - p_WC)]

    N = arm.kinematics(q).R_WT[:, :2].T
    return np.array([(residual(q + h * e) - residual(q - h * e)) / (2 * h) for e in np.eye(7)]).T


def _mu_gradient(arm, q, h=1e-5):
    return np.array([(_mu(arm, q + h * e) - _mu(arm, q - h * e)) / (2 * h) for e in np.eye(7)])


@seeds
@pytest.mark.parametrize("trocar", [True, False])
def test_projection_lands_on_the_manifold_near_where_it_began(arm, manifold, velocity_problem, seed, trocar):
    p = velocity_problem(seed, rcm_error_m=0.0)
    p_WC = p.p_WC if trocar else None
    start = p.q + 0.03 * np.random.default_rng(seed).standard_normal(7)
    point = manifold.project(start, p.kin.p_WT, p_WC)
    assert max(_miss(arm, start, p.kin.p_WT, p_WC)) > 1e-3
    assert max(_miss(arm, point.q, p.kin.p_WT, p_WC)) < 1e-10
    assert point.miss < 1e-10
    assert point.mu == pytest.approx(_mu(arm, point.q), rel=1e-9)
    assert np.linalg.norm(point.q - start) <= 1.2 * np.linalg.norm(p.q - start)


@seeds
def test_projection_of_a_point_of_the_manifold_is_itself(manifold, velocity_problem, seed):
    p = velocity_problem(seed, rcm_error_m=0.0)
    np.testing.assert_allclose(manifold.project(p.q, p.kin.p_WT, p.p_WC).q, p.q, atol=1e-10)


def _assert_stationary(arm, manifold, point, p_WC):
    """The gradient of mu has no part along the manifold but what points out of a joint limit."""
    q = point.q
    gradient = _mu_gradient(arm, q)
    blocked_high = (q > arm.limits.q_max - 0.002 - 1e-5) & (gradient > 0)
    blocked_low = (q < arm.limits.q_min + 0.002 + 1e-5) & (gradient < 0)
    rows = [_constraint_jacobian(arm, q, p_WC), np.eye(7)[blocked_high | blocked_low]]
    Z = null_space(np.vstack(rows), rcond=1e-8)
    assert np.linalg.norm(Z.T @ gradient) < 1e-4 * max(1.0, np.linalg.norm(gradient))


@seeds
@pytest.mark.parametrize("trocar", [True, False])
def test_a_climb_ends_where_the_gradient_along_the_manifold_vanishes(
    arm, manifold, velocity_problem, seed, trocar
):
    p = velocity_problem(seed, rcm_error_m=0.0)
    p_WC = p.p_WC if trocar else None
    before = manifold.project(p.q, p.kin.p_WT, p_WC)
    top = manifold.climb(p.q, p.kin.p_WT, p_WC)
    assert manifold.inside(top)
    assert max(_miss(arm, top.q, p.kin.p_WT, p_WC)) < 1e-8
    assert top.mu > before.mu
    _assert_stationary(arm, manifold, top, p_WC)


@pytest.mark.parametrize("seed", [0, 1, 18, 26])  # of the last two, an unguarded step goes down
def test_mu_never_decreases_during_a_climb(arm, manifold, seed):
    q = 0.85 * np.random.default_rng(seed).uniform(arm.limits.q_min, arm.limits.q_max)
    kin = arm.kinematics(q)
    p_WC = kin.p_WT - 0.2 * kin.R_WT[:, 2]
    mu = [manifold.climb(q, kin.p_WT, p_WC, steps=steps).mu for steps in range(12)]
    assert (np.diff(mu) >= 0.0).all()
    assert mu[-1] > mu[0]


def test_a_climb_from_outside_the_limits_comes_inside(arm, manifold, curve):
    q = curve[-1].q.copy()
    way = (curve[-1].q - curve[-2].q) / np.linalg.norm(curve[-1].q - curve[-2].q)
    outside = manifold.project(q + 0.1 * way, P_WT, P_WC)
    assert not manifold.inside(outside)
    assert outside.miss < 1e-8
    assert manifold.inside(manifold.climb(outside.q, P_WT, P_WC))


def test_every_point_of_the_swivel_curve_is_on_the_manifold_inside_the_limits(arm, curve):
    for point in curve:
        assert max(_miss(arm, point.q, P_WT, P_WC)) < 1e-8
        assert (point.q >= arm.limits.q_min).all()
        assert (point.q <= arm.limits.q_max).all()
    steps = np.linalg.norm(np.diff([point.q for point in curve], axis=0), axis=1)
    assert steps.max() < 0.021
    assert steps.min() > 0.015


def test_the_swivel_curve_is_closed_or_ends_at_limits(arm, manifold, curve):
    q = np.array([point.q for point in curve])
    closed = np.linalg.norm(q[0] - q[-1]) < 0.04
    room = np.minimum(q - arm.limits.q_min, arm.limits.q_max - q).min(axis=1)
    assert closed or max(room[0], room[-1]) < 0.002 + 0.02


def test_the_swivel_curve_turns_the_elbow_one_way_and_leaves_the_instrument_where_it_is(arm, curve):
    angles = np.unwrap([elbow_swivel_rad(point.kin) for point in curve])
    turns = np.diff(angles)
    assert (turns > 0).all() or (turns < 0).all()
    assert np.ptp(angles) > 3.0
    wrists = np.array([point.kin.anchors_W[5] for point in curve])
    np.testing.assert_allclose(wrists, np.broadcast_to(wrists[0], wrists.shape), atol=1e-8)


def test_the_optimum_is_the_largest_mu_of_the_swivel_curve(arm, manifold, here, curve):
    brute = np.array([_mu(arm, point.q) for point in curve])
    best = max(manifold.optima(here, P_WT, P_WC, 24), key=lambda point: point.mu)
    assert best.mu >= brute.max()
    assert best.mu == pytest.approx(brute.max(), rel=1e-3)  # between two points 0.02 rad apart
    assert brute.max() > 1.5 * brute.min()


def test_a_climb_from_anywhere_on_the_curve_reaches_the_peak_uphill(manifold, curve):
    mu = np.array([point.mu for point in curve])
    for start in (5, 60, 200, len(curve) - 5):
        low = high = start
        while high + 1 < len(mu) and mu[high + 1] > mu[high]:
            high += 1
        while low > 0 and mu[low - 1] > mu[low]:
            low -= 1
        peak = high if high > start else low
        top = manifold.climb(curve[start].q, P_WT, P_WC)
        assert top.mu >= mu[start]
        assert top.mu == pytest.approx(mu[peak], rel=1e-3) or top.mu > mu[peak]


def test_the_elbow_angle_is_zero_on_top_and_half_a_turn_below(arm):
    up = arm.kinematics(np.array([0.3, 0.5, 0.0, 1.2, 0.0, 0.7, 0.0]))
    angle = elbow_swivel_rad(up)
    assert min(abs(angle), abs(abs(angle) - np.pi)) < 1e-9
    elbow_over_line = up.anchors_W[3] - 0.5 * (up.anchors_W[1] + up.anchors_W[5])
    assert (abs(angle) < 1e-9) == (elbow_over_line[2] > 0)
