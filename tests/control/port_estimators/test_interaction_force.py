"""Interaction force: an unseen port found from the wall's force alone, and what misleads it."""

from dataclasses import replace

import numpy as np
import pytest

from surgsim.control.port_estimators.interaction_force import InteractionForceConfig
from surgsim.control.rcm import rcm_kinematics

DT = 0.001
K = 1000.0


def _run(arm, problem, force_of, seconds, constant=None, **config):
    """Estimates while a lateral force (t, estimate) -> (2,) [N] acts on the shaft, which does not move."""
    rcm = rcm_kinematics(problem.kin, problem.p_WC, np.zeros(3))
    estimator = InteractionForceConfig(**config).build(arm)
    memory, offset, out = estimator.start(problem), np.zeros(3), []
    extra = np.zeros(7) if constant is None else constant
    for k in range(round(seconds / DT)):
        t = k * DT
        f = force_of(t, rcm.normals @ offset)
        tau = problem.dyn.bias - f @ rcm.jacobian - extra  # what the motors hold against it
        estimate, memory = estimator.step(replace(problem, t_s=t, tau_measured=tau), memory)
        offset = estimate.p_WC - problem.p_WC
        out.append(rcm.normals @ offset)
    return np.array(out), rcm


def test_the_estimate_goes_to_where_the_wall_is_as_a_first_order_lag(arm, problem):
    """O' = -G K (o - c): the shaft is taken to follow the estimate at once."""
    place = np.array([0.003, -0.001])
    out, _ = _run(
        arm, problem, lambda t, o: K * (place - o), 0.5, tare_s=0.0, observer_hz=150.0, state_hz=150.0
    )
    t = np.arange(len(out)) * DT
    expected = place * (1.0 - np.exp(-0.02 * K * t))[:, None]
    np.testing.assert_allclose(out, expected, atol=1e-4)
    np.testing.assert_allclose(out[-1], place, atol=1e-6)


def test_what_acts_from_the_start_is_taken_off(arm, problem):
    payload = 0.2 * 9.81 * problem.kin.Jv_WT[2]
    push = lambda t, o: K * (np.array([0.002, 0.0]) - o) if t > 0.3 else np.zeros(2)  # noqa: E731
    with_it, _ = _run(arm, problem, push, 1.0, constant=payload, tare_s=0.2, observer_hz=40.0, state_hz=60.0)
    np.testing.assert_allclose(with_it[-1], [0.002, 0.0], atol=2e-5)
    without, _ = _run(arm, problem, push, 1.0, constant=payload, tare_s=0.0, observer_hz=40.0, state_hz=60.0)
    assert np.abs(without[-1] - [0.002, 0.0]).max() > 2e-4


@pytest.mark.parametrize("stiffness", [300.0, 1000.0, 3000.0])
def test_harmonics_leave_no_force_at_the_breathing_rate(arm, problem, stiffness):
    def wave(t):
        return 0.0025 * (1.0 - np.cos(2.0 * np.pi * t))

    def breath(t, o):
        return stiffness * (np.array([wave(t), 0.0]) - o)

    errors = []
    for rate in (None, 1.0):
        out, _ = _run(arm, problem, breath, 8.0, tare_s=0.0, rate_hz=rate, observer_hz=150.0, state_hz=150.0)
        t = np.arange(len(out)) * DT
        errors.append(np.abs(out[t > 7.0, 0] - wave(t[t > 7.0])).max())
    assert errors[1] < 0.1 * errors[0]


def test_nothing_is_learnt_along_the_shaft(arm, problem):
    d = problem.kin.R_WT[:, 2]
    rcm = rcm_kinematics(problem.kin, problem.p_WC, np.zeros(3))
    estimator = InteractionForceConfig(tare_s=0.0).build(arm)
    memory = estimator.start(problem)
    tau = problem.dyn.bias - np.array([1.0, 0.5]) @ rcm.jacobian
    for _ in range(100):
        estimate, memory = estimator.step(replace(problem, tau_measured=tau), memory)
    moved = estimate.p_WC - problem.p_WC
    assert np.linalg.norm(moved) > 1e-4
    assert abs(d @ moved) < 1e-12


def test_the_estimate_stays_near_the_trocar_as_seen(arm, problem):
    out, _ = _run(arm, problem, lambda t, o: np.array([50.0, 0.0]), 1.0, tare_s=0.0, most_m=0.01)
    assert np.linalg.norm(out[-1]) == pytest.approx(0.01, rel=1e-9)


def test_small_forces_are_noise(arm, problem):
    out, _ = _run(arm, problem, lambda t, o: np.array([0.1, 0.0]), 0.5, tare_s=0.0, threshold_n=0.2)
    np.testing.assert_array_equal(out, 0.0)
