"""Passive QP: the paper's program, what each row does, and which of them give way."""

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.optimize import minimize
from usual_arm import usual_arm

from surgsim.control.failure import ControlFailure
from surgsim.control.planes import PlaneConfig
from surgsim.control.problem import braking_bounds
from surgsim.control.resolvers.passive_qp import PassiveQpConfig
from surgsim.control.seen import seen_of_velocity
from surgsim.control.tip_energy import MARGIN
from surgsim.tasks.base import EnergyBudget
from surgsim.tick.arrays import Resolved, new
from surgsim.tick.status import GOES_ON

seeds = pytest.mark.parametrize("seed", range(5))


def _problem(velocity_problem, seed, *, budget=None, speed=0.02, roll_rate=0.3):
    p = velocity_problem(seed, speed=speed, rcm_error_m=1e-4, trocar_speed=0.0)
    return replace(p, v=np.zeros(7), command=replace(p.command, budget=budget, roll_rate=roll_rate))


def _steps(config, p, count=400):
    """The answer after `count` periods at the same place, when no acceleration bound is active any more."""
    resolver = config.build(usual_arm())
    memory = resolver.start(p)
    for _ in range(count):
        answer, memory = resolver.step(p, memory)
    return answer


def _slack(answer):
    return answer.values[:4]


def _active(answer):
    return dict(zip(("passivity", "planes", "relaxed"), answer.values[4:], strict=True))


@seeds
def test_without_an_active_bound_tip_and_roll_are_met_with_the_rcm_exact(velocity_problem, seed):
    p = _problem(velocity_problem, seed, speed=0.01)
    answer = _steps(PassiveQpConfig(roll_slack_weight=1e6), p)
    np.testing.assert_allclose(p.rcm.jacobian @ answer.qdot, -5.0 * p.rcm.error, atol=1e-10)
    np.testing.assert_allclose(p.kin.Jv_WT @ answer.qdot - p.command.v_WTd, _slack(answer)[:3], atol=1e-10)
    assert np.abs(_slack(answer)).max() < 1e-4
    assert p.kin.R_WT[:, 2] @ p.kin.Jw_WT @ answer.qdot == pytest.approx(0.3, abs=1e-4)
    assert _active(answer) == {"passivity": 0.0, "planes": 0.0, "relaxed": 0.0}


@seeds
def test_the_program_is_the_paper_s(velocity_problem, seed):
    """Against SLSQP on the slack-free form of the objective, with a binding energy budget."""
    f_T = -40.0 * _unit(seed)
    p = _problem(velocity_problem, seed, budget=EnergyBudget(most_j=1e-4, f_T=f_T), speed=0.05)
    c = PassiveQpConfig(slack_weight=50.0, roll_slack_weight=3.0, k_rcm=4.0)
    answer = _steps(c, p)
    J, roll = p.kin.Jv_WT, p.kin.R_WT[:, 2] @ p.kin.Jw_WT

    def cost(x):
        tip, turn = J @ x - p.command.v_WTd, roll @ x - 0.3
        return 0.5 * x @ x + 50.0 * tip @ tip + 3.0 * turn**2

    def slope(x):
        return x + 100.0 * J.T @ (J @ x - p.command.v_WTd) + 6.0 * roll * (roll @ x - 0.3)

    rows = [
        {
            "type": "eq",
            "fun": lambda x: p.rcm.jacobian @ x + 4.0 * p.rcm.error,
            "jac": lambda x: p.rcm.jacobian,
        },
        {"type": "ineq", "fun": lambda x: 1e-4 / p.dt_s + f_T @ J @ x, "jac": lambda x: f_T @ J},
    ]
    lower, upper = p.lower, p.upper
    best = minimize(
        cost,
        np.zeros(7),
        jac=slope,
        method="SLSQP",
        bounds=list(zip(lower, upper, strict=True)),
        constraints=rows,
        options={"ftol": 1e-14, "maxiter": 500},
    )
    assert best.success
    assert cost(answer.qdot) == pytest.approx(best.fun, rel=1e-6)
    np.testing.assert_allclose(answer.qdot, best.x, atol=2e-5)


def _unit(seed):
    v = np.random.default_rng(seed + 50).standard_normal(3)
    return v / np.linalg.norm(v)


@seeds
@pytest.mark.parametrize("most_j", [0.0, 1e-5, 1e-2])
def test_the_tip_gives_the_surroundings_no_more_than_the_budget(velocity_problem, seed, most_j):
    p = _problem(velocity_problem, seed, speed=0.05)
    f_T = -30.0 * p.command.v_WTd / np.linalg.norm(p.command.v_WTd)  # the surroundings resist the command
    p = replace(p, command=replace(p.command, budget=EnergyBudget(most_j=most_j, f_T=f_T)))
    answer = _steps(PassiveQpConfig(), p)
    given = -p.dt_s * f_T @ p.kin.Jv_WT @ answer.qdot
    assert given <= most_j + 1e-9
    assert _active(answer)["passivity"] == float(most_j < 1e-2)
    np.testing.assert_allclose(p.rcm.jacobian @ answer.qdot, -5.0 * p.rcm.error, atol=1e-9)


def test_an_overdrawn_budget_stops_the_tip_and_asks_for_no_refill(velocity_problem):
    p = _problem(velocity_problem, 1, speed=0.05)
    f_T = -30.0 * p.command.v_WTd / np.linalg.norm(p.command.v_WTd)
    at = [
        _steps(
            PassiveQpConfig(), replace(p, command=replace(p.command, budget=EnergyBudget(most_j=j, f_T=f_T)))
        )
        for j in (0.0, -1.0)
    ]
    np.testing.assert_array_equal(at[0].qdot, at[1].qdot)


def test_motion_that_takes_energy_from_the_surroundings_is_free(velocity_problem):
    p = _problem(velocity_problem, 2, speed=0.02)
    helping = EnergyBudget(most_j=0.0, f_T=30.0 * p.command.v_WTd / np.linalg.norm(p.command.v_WTd))
    with_it = _steps(PassiveQpConfig(), replace(p, command=replace(p.command, budget=helping)))
    np.testing.assert_allclose(with_it.qdot, _steps(PassiveQpConfig(), p).qdot, atol=1e-9)


@seeds
def test_at_a_wall_the_slack_takes_the_rest_and_the_rcm_nothing(velocity_problem, seed):
    p = _problem(velocity_problem, seed, speed=0.05)
    normal = p.command.v_WTd / np.linalg.norm(p.command.v_WTd)
    wall = PlaneConfig(normal=tuple(normal), offset_m=float(normal @ p.kin.p_WT))  # the tip is on it
    answer = _steps(PassiveQpConfig(planes=(wall,)), p)
    assert normal @ p.kin.Jv_WT @ answer.qdot <= 1e-9
    assert _active(answer)["planes"] == 1.0
    assert np.linalg.norm(_slack(answer)[:3]) == pytest.approx(np.linalg.norm(p.command.v_WTd), rel=0.2)
    np.testing.assert_allclose(p.rcm.jacobian @ answer.qdot, -5.0 * p.rcm.error, atol=1e-9)


@seeds
def test_the_speed_limit_holds_along_each_axis(velocity_problem, seed):
    p = _problem(velocity_problem, seed, speed=0.5)
    answer = _steps(PassiveQpConfig(tip_speed_max_m_per_s=0.02), p)
    assert np.abs(p.kin.Jv_WT @ answer.qdot).max() <= 0.02 + 1e-9


@seeds
def test_accelerations_stay_inside_their_limits_from_tick_to_tick(velocity_problem, seed):
    p = _problem(velocity_problem, seed, speed=0.1)
    resolver = PassiveQpConfig().build(usual_arm())
    memory, last = resolver.start(p), p.v
    for _ in range(20):
        low, high = braking_bounds(p, last)
        answer, memory = resolver.step(p, memory)
        last = answer.qdot
        if not _active(answer)["relaxed"]:
            assert (answer.qdot >= low - 1e-9).all()
            assert (answer.qdot <= high + 1e-9).all()


def test_a_budget_that_ends_in_full_motion_relaxes_the_acceleration_and_says_so(velocity_problem):
    p = _problem(velocity_problem, 3, speed=0.1)
    resolver = PassiveQpConfig().build(usual_arm())
    memory = resolver.start(p)
    for _ in range(400):
        _, memory = resolver.step(p, memory)
    f_T = -30.0 * p.command.v_WTd / np.linalg.norm(p.command.v_WTd)
    stopped = replace(p, command=replace(p.command, budget=EnergyBudget(most_j=0.0, f_T=f_T)))
    answer, _ = resolver.step(stopped, memory)
    assert _active(answer)["relaxed"] == 1.0
    assert -f_T @ p.kin.Jv_WT @ answer.qdot <= 1e-9


def test_rows_that_exclude_each_other_are_infeasible_with_their_matrices(velocity_problem):
    p = _problem(velocity_problem, 4)
    far = PlaneConfig(normal=(0.0, 0.0, 1.0), offset_m=float(p.kin.p_WT[2]) - 1.0)  # 1 m inside: 20 m/s asked
    resolver = PassiveQpConfig(planes=(far,)).build(usual_arm())
    with pytest.raises(ControlFailure, match="1 planes, the energy budget") as failure:
        resolver.step(p, resolver.start(p))
    assert {"H", "G", "G_upper"} <= set(failure.value.data)


def test_the_resolved_motion_leads_the_measured_tip_by_no_more_than_allowed(velocity_problem):
    p = _problem(velocity_problem, 5, speed=0.1)
    resolver = PassiveQpConfig(lead_max_m=0.002).build(usual_arm())
    memory = resolver.start(p)
    for _ in range(1000):  # the tip is held where it is
        answer, memory = resolver.step(p, memory)
    lead = np.linalg.norm(answer.command.p_WTd - p.kin.p_WT)
    assert lead == pytest.approx(0.002 + p.dt_s * np.linalg.norm(answer.command.v_WTd), rel=0.01)


@seeds
def test_the_kinetic_scale_follows_a_share_of_the_budget_with_its_lag(velocity_problem, seed):
    """Against the closed form, with the tip's inertia by the constrained inverse of the mass matrix."""
    arm = usual_arm()
    p = _problem(velocity_problem, seed, budget=EnergyBudget(most_j=2e-4, f_T=np.zeros(3)), speed=0.05)
    M, J, v_d = arm.dynamics(p.q, p.v).mass_matrix, p.rcm.jacobian, p.command.v_WTd
    inverse = np.linalg.inv(M)
    held = inverse - inverse @ J.T @ np.linalg.inv(J @ inverse @ J.T) @ J @ inverse
    inertia = np.linalg.inv(p.kin.Jv_WT @ held @ p.kin.Jv_WT.T)
    covered = np.sqrt(0.25 * 2e-4 / (0.5 * MARGIN * v_d @ inertia @ v_d))
    assert 1e-3 < covered < 0.9
    config = PassiveQpConfig(passivity=False, kinetic=True, kinetic_lag_s=0.05, kinetic_share=0.25)
    resolver = config.build(arm)
    seen, out = seen_of_velocity(p, arm), new(Resolved, 7)
    seen["M"], memory = M, np.zeros(resolver.memory_size)
    for count in range(1, 400):
        seen["first"] = count == 1
        assert resolver.kernel(resolver.gains, seen, memory, out) == GOES_ON
        scale = covered + (1.0 - covered) * (1.0 - p.dt_s / 0.05) ** count
        np.testing.assert_allclose(p.kin.Jv_WT @ out["qdot"] - out["values"][:3], scale * v_d, atol=1e-9)
        assert out["values"][4] == 1.0


@pytest.mark.parametrize("key", ["kinetic_lag_s", "kinetic_share"])
def test_a_scale_without_kinetic_is_refused(key):
    with pytest.raises(ValidationError, match=f"{key} needs kinetic: true"):
        PassiveQpConfig(**{key: 0.5})
