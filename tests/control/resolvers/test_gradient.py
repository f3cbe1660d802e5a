"""Gradient projection against a projector written out and a gradient by finite differences."""

from dataclasses import replace

import numpy as np
import pytest
from usual_arm import usual_arm

from surgsim.control.resolvers.gradient import GradientConfig

seeds = pytest.mark.parametrize("seed", range(4))


def _unbounded(problem):
    return replace(problem, lower=np.full(7, -np.inf), upper=np.full(7, np.inf))


def _answer(problem, **config):
    resolver = GradientConfig(**config).build(usual_arm())
    return resolver.step(problem, resolver.start(problem))[0]


def _log_mu(arm, q):
    return np.log(np.linalg.svd(arm.kinematics(q).Jv_WT, compute_uv=False)).sum()


def _log_mu_gradient(arm, q, h=1e-6):
    return np.array([(_log_mu(arm, q + h * e) - _log_mu(arm, q - h * e)) / (2 * h) for e in np.eye(7)])


def _rows(p, *, rcm):
    tip = p.command.v_WTd - 5.0 * (p.kin.p_WT - p.command.p_WTd)
    if not rcm:
        return p.kin.Jv_WT, tip
    N = p.kin.R_WT[:, :2].T
    shaft = N @ p.v_WC - 5.0 * N @ (p.kin.p_WT - p.p_WC)
    return np.vstack([p.kin.Jv_WT, p.rcm.jacobian]), np.concatenate([tip, shaft])


@seeds
@pytest.mark.parametrize(("trocar", "rcm"), [(True, True), (True, False), (False, True)])
@pytest.mark.parametrize("gain", [0.0, 0.3])
def test_answer_is_pinv_plus_the_projected_gradient(arm, velocity_problem, seed, trocar, rcm, gain):
    p = _unbounded(velocity_problem(seed, trocar=trocar))
    J, v = _rows(p, rcm=trocar and rcm)
    J_pinv = np.linalg.pinv(J)
    climb = gain * _log_mu_gradient(arm, p.q)
    climb /= max(1.0, np.max(np.abs(climb) / p.limits.velocity))  # cut as a whole at the velocity limits
    expected = J_pinv @ v + (np.eye(7) - J_pinv @ J) @ climb
    answer = _answer(p, gain_rad2_per_s=gain, rcm=rcm)
    np.testing.assert_allclose(answer.qdot, expected, atol=1e-7)
    assert answer.residual < 1e-12


@seeds
@pytest.mark.parametrize("trocar", [True, False])
def test_self_motion_climbs_and_moves_neither_tip_nor_shaft(arm, velocity_problem, seed, trocar):
    p = _unbounded(velocity_problem(seed, trocar=trocar))
    slow, fast = (_answer(p, gain_rad2_per_s=gain).qdot for gain in (0.0, 0.3))
    climb = fast - slow
    assert _log_mu_gradient(arm, p.q) @ climb > 1e-4
    np.testing.assert_allclose(_rows(p, rcm=trocar)[0] @ climb, 0.0, atol=1e-12)


@seeds
def test_a_large_gain_is_cut_at_the_velocity_limits_before_it_is_projected(arm, velocity_problem, seed):
    p = _unbounded(velocity_problem(seed))
    J, v = _rows(p, rcm=True)
    gradient = _log_mu_gradient(arm, p.q)
    climb = gradient / np.max(np.abs(gradient) / p.limits.velocity)
    J_pinv = np.linalg.pinv(J)
    expected = J_pinv @ v + (np.eye(7) - J_pinv @ J) @ climb
    for gain in (1e3, 1e6):
        np.testing.assert_allclose(_answer(p, gain_rad2_per_s=gain).qdot, expected, atol=1e-6)


@seeds
def test_beyond_the_bounds_the_answer_is_cut_at_them(velocity_problem, seed):
    p = velocity_problem(seed, speed=5.0)
    free = _answer(_unbounded(p), gain_rad2_per_s=0.3).qdot
    answer = _answer(p, gain_rad2_per_s=0.3)
    np.testing.assert_array_equal(answer.qdot, np.clip(free, p.lower, p.upper))
    assert answer.residual > 1e-3
