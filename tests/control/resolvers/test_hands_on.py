"""Hands-on guidance: the admittance, the lever about the port, the walls; nobody there, and a whole run."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lsim

import surgsim
from surgsim.control.resolvers.hands_on import HandsOnConfig
from surgsim.control.resolvers.pinv import PinvConfig
from surgsim.errors import Outcome
from surgsim.plant.state import Wrench

DT, HAND = 0.001, 0.4


@pytest.fixture
def problem(velocity_problem):
    return velocity_problem(2, rcm_error_m=0.0, trocar_speed=0.0, speed=0.0)


def _held(problem, hand, wall=(0.0, 0.0, 0.0)):
    """The wrench of a hand on the shaft and of the wall."""
    z, depth = problem.kin.R_WT[:, 2], problem.rcm.depth
    hand, wall = np.asarray(hand), np.asarray(wall)
    moment = np.cross(-HAND * z, hand) + np.cross(-depth * z, wall)
    return Wrench(force=hand + wall, moment=moment)


def _led(arm, problem, hand_of, seconds, wall=(0.0, 0.0, 0.0), **config):
    """How far the tip is led from its path (ticks, 3) [m] and how fast, and the force in the column."""
    config = {"tare_s": 0.0, "dead_zone_n": 0.0, "most_m": 10.0, **config}
    law = HandsOnConfig(**config).build(arm)
    memory, away, rates, felt = law.start(problem), [], [], []
    told = problem.command
    for k in range(round(seconds / DT)):
        now = replace(problem, t_s=k * DT, wrench=_held(problem, hand_of(k * DT), wall))
        resolution, memory = law.step(now, memory)
        own = resolution.command or told
        away.append(own.p_WTd - told.p_WTd)
        rates.append(own.v_WTd - told.v_WTd)
        felt.append(resolution.values[-3:])
    return np.array(away), np.array(rates), np.array(felt)


def _equivalent(problem, hand):
    """The force at the tip that does the hand's work, the shaft turning about the port."""
    z, depth = problem.kin.R_WT[:, 2], problem.rcm.depth
    axial = (hand @ z) * z
    return axial - (HAND - depth) / depth * (hand - axial)


@pytest.mark.parametrize(("mass", "damping", "stiffness"), [(2.0, 30.0, 0.0), (1.0, 10.0, 100.0)])
def test_the_tip_moves_as_the_mass_that_it_says(arm, problem, mass, damping, stiffness):
    """Against the state space's exact solution; the wall's force moves nothing."""
    direction = np.array([0.6, -0.3, 0.5])
    away, rates, felt = _led(
        arm, problem, lambda t: 2.0 * np.sin(4.0 * t) * direction, 1.0,
        wall=3.0 * problem.kin.R_WT[:, 1],
        mass_kg=mass, damping_n_s_per_m=damping, stiffness_n_per_m=stiffness,
    )  # fmt: skip
    force = _equivalent(problem, direction)
    unit = force / np.linalg.norm(force)
    t = DT * np.arange(1, len(away) + 1)
    A = np.array([[0.0, 1.0], [-stiffness / mass, -damping / mass]])
    system = (A, np.array([[0.0], [1.0 / mass]]), np.eye(2), np.zeros((2, 1)))
    _, states, _ = lsim(system, 2.0 * np.linalg.norm(force) * np.sin(4.0 * (t - DT)), t)
    scale = np.abs(states).max(axis=0)
    np.testing.assert_allclose(away @ unit, states[:, 0], atol=0.02 * scale[0])
    np.testing.assert_allclose(rates @ unit, states[:, 1], atol=0.02 * scale[1])
    np.testing.assert_allclose(felt[-1], 2.0 * np.sin(4.0 * (t[-1] - DT)) * direction, atol=1e-9)


def test_the_hand_does_the_work_that_the_tip_takes(arm, problem):
    """The shaft slides through the port and turns about it, as a rigid body: F_h v_h = F_T v_T.

    F_T is taken from the kernel: what a kilogram gains in one period.
    """
    z, port, tip = problem.kin.R_WT[:, 2], problem.p_WC, problem.kin.p_WT
    place, rng = tip - HAND * z, np.random.default_rng(0)
    for _ in range(20):
        hand, turn, slide = rng.normal(size=3), rng.normal(size=3), rng.normal()
        _, rates, _ = _led(arm, problem, lambda t, F=hand: F, DT, mass_kg=1.0, damping_n_s_per_m=1e-9)
        at_tip = rates[0] / DT
        v_tip = np.cross(turn, tip - port) + slide * z
        v_hand = np.cross(turn, place - port) + slide * z
        assert hand @ v_hand == pytest.approx(at_tip @ v_tip, rel=1e-6, abs=1e-9)


def test_a_wall_that_the_path_itself_passes_throws_nothing(arm, problem):
    """Walls hold back the hand, and move along with a path that comes too near."""
    for beyond in (-0.05, 0.0, 0.005):
        offset = float(problem.command.p_WTd[0]) + beyond
        wall = {"normal": (1.0, 0.0, 0.0), "offset_m": offset}
        away, rates, _ = _led(arm, problem, lambda t: np.zeros(3), 0.1, planes=(wall,))
        assert not away.any()
        assert not rates.any()


def test_no_energy_comes_back_that_was_not_given(arm, problem):
    """A hand that pushes at random can never take out more than it put in: the admittance is passive."""
    rng = np.random.default_rng(3)
    pushes = np.cumsum(rng.normal(size=(800, 3)), axis=0) * 0.1
    _, rates, _ = _led(arm, problem, lambda t: pushes[min(round(t / DT), 799)], 0.8, stiffness_n_per_m=50.0)
    power = [_equivalent(problem, push) @ rate for push, rate in zip(pushes, rates, strict=True)]
    assert np.min(np.cumsum(power)) * DT >= -1e-9


def test_a_wall_is_not_passed(arm, problem):
    """Against 30 N the tip stays on the inner side of the wall."""
    normal = problem.kin.R_WT[:, 2]
    place = float(normal @ problem.command.p_WTd) + 0.02
    wall = {"normal": tuple(normal.tolist()), "offset_m": place}
    away, _, _ = _led(
        arm, problem, lambda t: 30.0 * normal, 2.0, planes=(wall,), barrier_n_m3=1e-5, damping_n_s_per_m=60.0
    )
    reached = away @ normal
    assert 0.005 < reached.max() < 0.02


def test_when_nobody_is_there_it_is_the_resolver_below(arm, problem):
    alone, _ = PinvConfig().build(arm).step(problem, None)
    for given in (problem, replace(problem, wrench=Wrench(force=np.zeros(3), moment=np.zeros(3)))):
        below, _ = HandsOnConfig().build(arm).step(given, None)
        assert np.array_equal(below.qdot, alone.qdot)
        assert below.residual == alone.residual


def test_the_way_is_bounded_and_a_force_of_the_beginning_is_taken_off(arm, problem):
    push = 10.0 * problem.kin.R_WT[:, 0]
    away, _, _ = _led(arm, problem, lambda t: push, 1.0, most_m=0.03)
    assert np.linalg.norm(away, axis=1).max() == pytest.approx(0.03)
    away, _, felt = _led(arm, problem, lambda t: push, 0.3, tare_s=0.1, dead_zone_n=0.1)
    assert np.abs(away).max() < 1e-12
    assert np.abs(felt).max() < 1e-12


@pytest.mark.parametrize("arm_name", ["lwr4plus", "panda"])
def test_a_hand_leads_the_instrument_and_strains_nothing(arm_name):
    run = surgsim.run(f"hands_on_guidance_{arm_name}")
    trace = run.trace
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    error = 1e3 * trace["tip_error_m"].ravel()
    t = trace["t_s"].ravel()
    assert error.max() > 15.0
    assert error[np.searchsorted(t, 8.0) :].max() < 0.01
    assert run.metrics["rcm_error_max_mm"] < 0.01
    assert run.metrics["trocar_force_max_n"] < 0.5
    held = surgsim.run(f"hands_on_guidance_{arm_name}", controller="rcm_inverse_dynamics")
    strength = [np.abs(of.trace.block("flange_force")).max() for of in (run, held)]
    assert strength[0] < 0.3 * strength[1]
