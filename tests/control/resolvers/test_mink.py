"""mink as a resolver: the same rows as the others, within the effect of its damping."""

from dataclasses import replace

import numpy as np
import pytest
from usual_arm import usual_arm

from surgsim.control.failure import ControlFailure
from surgsim.control.resolvers.mink import MinkConfig
from surgsim.control.resolvers.pinv import PinvConfig
from surgsim.errors import Outcome
from surgsim.simulate.loop import simulate

seeds = pytest.mark.parametrize("seed", range(5))


def _mink(arm, p, **config):
    resolver = MinkConfig(**config).build(arm)
    return resolver.step(p, resolver.start(p))[0]


@seeds
@pytest.mark.parametrize("trocar", [True, False])
def test_answer_is_that_of_the_pseudo_inverse(arm, velocity_problem, seed, trocar):
    p = velocity_problem(seed, trocar=trocar, speed=0.005)
    pinv = PinvConfig(k_tip=3.0, k_rcm=7.0).build(usual_arm())
    expected = pinv.step(p, None)[0].qdot
    assert (np.abs(expected) < p.upper).all()
    answer = _mink(arm, p, k_tip=3.0, k_rcm=7.0)
    np.testing.assert_allclose(answer.qdot, expected, atol=2e-4 * np.abs(expected).max())
    assert answer.residual < 1e-5


@seeds
def test_more_damping_gives_the_tip_away_but_not_the_rcm(arm, velocity_problem, seed):
    p = velocity_problem(seed, speed=0.02)
    wanted = p.rcm.trocar_velocity - 5.0 * p.rcm.error
    exact, damped = (_mink(arm, p, damping=damping) for damping in (1e-9, 0.1))
    assert damped.residual > 100.0 * exact.residual
    for answer in (exact, damped):
        np.testing.assert_allclose(p.rcm.jacobian @ answer.qdot, wanted, atol=1e-8)
    assert np.linalg.norm(damped.qdot) < np.linalg.norm(exact.qdot)


@seeds
def test_at_the_bounds_the_tip_gives_way_and_the_rcm_does_not(arm, velocity_problem, seed):
    p = velocity_problem(seed, speed=5.0)
    answer = _mink(arm, p)
    assert (answer.qdot >= p.lower).all()
    assert (answer.qdot <= p.upper).all()
    assert (np.isclose(answer.qdot, p.lower) | np.isclose(answer.qdot, p.upper)).any()
    wanted = p.rcm.trocar_velocity - 5.0 * p.rcm.error
    np.testing.assert_allclose(p.rcm.jacobian @ answer.qdot, wanted, atol=1e-7)
    assert answer.residual > 0.1


def test_near_a_position_limit_the_approach_is_bounded_as_in_omega(arm, velocity_problem, random_q):
    """mink's own limit, before the projection on Omega that every resolver shares."""
    q = random_q(np.random.default_rng(3))
    q[3] = arm.limits.q_max[3] - 0.002
    p = replace(velocity_problem(3, q=q), lower=np.full(7, -np.inf), upper=np.full(7, np.inf))
    away = p.kin.Jv_WT[:, 3] / np.linalg.norm(p.kin.Jv_WT[:, 3])
    p = replace(p, rcm=None, command=replace(p.command, v_WTd=0.3 * away, p_WTd=p.kin.p_WT))
    answer = _mink(arm, p)
    assert answer.qdot[3] == pytest.approx(10.0 * 0.002, rel=1e-3)


def test_an_rcm_out_of_reach_is_an_outcome(arm, velocity_problem):
    p = velocity_problem(0, trocar_speed=50.0)
    with pytest.raises(ControlFailure, match="mink found no velocity") as failure:
        _mink(arm, p)
    assert failure.value.outcome is Outcome.INFEASIBLE
    assert failure.value.data["J"].shape == (5, 7)


def test_a_run_follows_the_path_as_the_pseudo_inverse_does(scenario):
    kinematic = "plant={type: kinematic}"
    mink, pinv = (
        simulate(scenario(kinematic, f"controller.resolver={{type: {t}}}")) for t in ("mink", "pinv")
    )
    np.testing.assert_allclose(mink.block("q"), pinv.block("q"), atol=1e-5)
    assert np.ptp(pinv.block("q"), axis=0).max() > 1e-3
