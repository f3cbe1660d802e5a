"""Pseudo-inverse resolver against numpy's, with and without the RCM rows."""

from dataclasses import replace

import numpy as np
import pytest
from usual_arm import usual_arm

from surgsim.control.resolvers.pinv import PinvConfig

seeds = pytest.mark.parametrize("seed", range(4))


def _unbounded(problem):
    return replace(problem, lower=np.full(7, -np.inf), upper=np.full(7, np.inf))


def _answer(problem, **config):
    resolver = PinvConfig(**config).build(usual_arm())
    return resolver.step(problem, resolver.start(problem))[0]


def _expected(p, k_tip, k_rcm, *, rcm):
    v = p.command.v_WTd + k_tip * (p.command.p_WTd - p.kin.p_WT)
    if not rcm:
        return np.linalg.pinv(p.kin.Jv_WT) @ v
    N, r = p.kin.R_WT[:, :2].T, p.kin.p_WT - p.p_WC
    v_rcm = N @ p.v_WC - k_rcm * N @ r
    return np.linalg.pinv(np.vstack([p.kin.Jv_WT, p.rcm.jacobian])) @ np.concatenate([v, v_rcm])


@seeds
@pytest.mark.parametrize(("trocar", "rcm"), [(True, True), (True, False), (False, True)])
def test_answer_is_the_pseudo_inverse_with_feedback(velocity_problem, seed, trocar, rcm):
    p = _unbounded(velocity_problem(seed, trocar=trocar))
    answer = _answer(p, k_tip=4.0, k_rcm=7.0, rcm=rcm)
    np.testing.assert_allclose(answer.qdot, _expected(p, 4.0, 7.0, rcm=trocar and rcm), atol=1e-10)
    assert answer.residual < 1e-12


@seeds
def test_rcm_rows_matter(velocity_problem, seed):
    p = _unbounded(velocity_problem(seed))
    with_rows, without = (_answer(p, rcm=rcm).qdot for rcm in (True, False))
    wanted = p.rcm.trocar_velocity - 5.0 * p.rcm.error
    np.testing.assert_allclose(p.rcm.jacobian @ with_rows, wanted, atol=1e-12)
    assert np.linalg.norm(p.rcm.jacobian @ without - wanted) > 1e-3


@seeds
def test_a_gain_of_zero_is_the_open_loop_scheme_of_the_paper(velocity_problem, seed):
    p = _unbounded(velocity_problem(seed, trocar=False))
    expected = np.linalg.pinv(p.kin.Jv_WT) @ p.command.v_WTd
    np.testing.assert_allclose(_answer(p, k_tip=0.0).qdot, expected, atol=1e-11)


@seeds
def test_beyond_the_bounds_the_answer_is_cut_at_them_and_the_residual_says_so(velocity_problem, seed):
    p = velocity_problem(seed, speed=5.0)
    answer = _answer(p)
    expected = np.clip(_expected(p, 5.0, 5.0, rcm=True), p.lower, p.upper)
    np.testing.assert_allclose(answer.qdot, expected, atol=1e-10)
    assert ((answer.qdot == p.lower) | (answer.qdot == p.upper)).any()
    assert answer.residual > 1e-3
