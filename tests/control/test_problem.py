"""Bounds Omega and the stacked rows of eq. (20)."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surgsim.control.problem import bounded_resolution, braking_bounds, stacked_rows, velocity_bounds


def _at(arm, fraction):
    return arm.limits.q_min + fraction * (arm.limits.q_max - arm.limits.q_min)


def test_far_from_the_position_limits_the_velocity_limits_bound(arm):
    lower, upper = velocity_bounds(_at(arm, 0.5), arm.limits, 10.0)
    np.testing.assert_array_equal(lower, -arm.limits.velocity)
    np.testing.assert_array_equal(upper, arm.limits.velocity)


def test_near_a_position_limit_the_distance_times_alpha_bounds(arm):
    lower, upper = velocity_bounds(arm.limits.q_max - 0.01, arm.limits, 10.0)
    np.testing.assert_allclose(upper, 0.1)
    np.testing.assert_array_equal(lower, -arm.limits.velocity)
    lower, upper = velocity_bounds(arm.limits.q_min + 0.01, arm.limits, 10.0)
    np.testing.assert_allclose(lower, -0.1)
    np.testing.assert_array_equal(upper, arm.limits.velocity)


@given(st.floats(-1.0, 2.0), st.floats(0.1, 1000.0))
def test_bounds_are_never_empty_and_drive_a_joint_past_its_limit_back(arm, fraction, alpha):
    lower, upper = velocity_bounds(_at(arm, fraction), arm.limits, alpha)
    assert (lower <= upper).all()
    assert (np.abs([lower, upper]) <= arm.limits.velocity).all()
    if fraction > 1.0 + 1e-9:
        assert (upper < 0.0).all()
    if fraction < -1e-9:
        assert (lower > 0.0).all()


@given(st.floats(0.0, 1.0), st.integers(0, 100))
def test_moving_inside_the_bounds_for_a_period_keeps_a_joint_in_its_range(arm, fraction, seed):
    q = _at(arm, fraction)
    lower, upper = velocity_bounds(q, arm.limits, 10.0)
    moved = q + 0.1 * np.random.default_rng(seed).uniform(lower, upper)  # alpha T = 1
    assert (moved >= arm.limits.q_min - 1e-12).all()
    assert (moved <= arm.limits.q_max + 1e-12).all()


def test_rows_follow_the_command_with_feedback(velocity_problem):
    p = velocity_problem(3)
    J, rhs = stacked_rows(p, 5.0, 7.0)
    np.testing.assert_array_equal(J, np.vstack([p.kin.Jv_WT, p.rcm.jacobian]))
    np.testing.assert_allclose(rhs[:3], p.command.v_WTd - 5.0 * (p.kin.p_WT - p.command.p_WTd))
    np.testing.assert_allclose(rhs[3:], p.rcm.trocar_velocity - 7.0 * p.rcm.error)
    J, rhs = stacked_rows(velocity_problem(3, trocar=False), 5.0, 7.0)
    assert (J.shape, rhs.shape) == ((3, 7), (3,))


@given(st.integers(0, 100), st.floats(0.0, 100.0))
@settings(deadline=None)
def test_a_bounded_answer_is_the_nearest_one_inside_with_its_residual(velocity_problem, seed, size):
    p = velocity_problem(seed)
    qdot = size * np.random.default_rng(seed).standard_normal(7)
    J, rhs = stacked_rows(p, 5.0, 5.0)
    answer = bounded_resolution(p, qdot, J, rhs)
    np.testing.assert_array_equal(answer.qdot, np.clip(qdot, p.lower, p.upper))
    assert answer.residual == pytest.approx(np.linalg.norm(J @ answer.qdot - rhs))


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("gain", [2.0, 10.0, 100.0])
def test_braking_bounds_let_every_joint_run_to_its_limit_and_stop_there(arm, velocity_problem, side, gain):
    """Full speed ahead from the middle: acceleration, speed and position limits all hold until rest."""
    limits, dt = arm.limits, 0.004
    q, v = 0.5 * (limits.q_min + limits.q_max), np.zeros(7)
    fastest = np.zeros(7)
    for _ in range(2500):
        lower, upper = velocity_bounds(q, limits, gain)
        p = replace(velocity_problem(0), q=q, dt_s=dt, lower=lower, upper=upper, position_gain_per_s=gain)
        low, high = braking_bounds(p, v)
        assert (low <= high).all()
        new = high if side > 0 else low
        assert (np.abs(new - v) <= limits.acceleration * dt * (1 + 1e-9)).all()
        assert (np.abs(new) <= limits.velocity * (1 + 1e-12)).all()
        q, v = q + dt * new, new
        fastest = np.maximum(fastest, np.abs(v))
        assert (q >= limits.q_min).all()
        assert (q <= limits.q_max).all()
    end = limits.q_max if side > 0 else limits.q_min
    np.testing.assert_allclose(q, end, atol=1e-3)
    assert (fastest > 0.5 * limits.velocity).all()
