"""The observer of elastic drives: its step against the whole system, its poles, its estimates."""

import math

import numpy as np
import pytest

import surgsim
from surgsim.control.elastic_observer import LINK, MOTOR, ROWS, W, factor_step, step
from surgsim.control.filters import filter_gains
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import prepare

N, T = 7, 1e-3


@pytest.fixture
def arm():
    rng = np.random.default_rng(3)
    root = rng.normal(size=(N, N))
    return {
        "M": root @ root.T + 0.1 * np.eye(N),
        "drives": np.array(
            [
                rng.uniform(3e3, 2e4, N),
                rng.uniform(0.05, 0.4, N),
                rng.uniform(5, 40, N),
                rng.uniform(0, 1, N),
                np.zeros(N),
            ]
        ),
        "x": rng.normal(size=(4, N)) * np.array([[1.0], [0.1], [1e-3], [0.1]]),
        "rest": rng.normal(size=N),
        "f": rng.normal(size=N),
        "u": rng.normal(size=N),
    }


def test_a_step_solves_the_trapezoidal_rule_of_all_states(arm):
    """With motors and links together, (1 - T A/2) x+ = (1 + T A/2) x + T b."""
    K, B, D, damping = (np.diag(row) for row in arm["drives"][:4])
    zero, one = np.zeros((N, N)), np.eye(N)
    mass = np.block(
        [
            [one, zero, zero, zero],
            [zero, arm["M"], zero, zero],
            [zero, zero, one, zero],
            [zero, zero, zero, B],
        ]
    )
    force = np.block(
        [[zero, one, zero, zero], [zero, -damping, K, zero], [zero, -one, zero, one], [zero, D, -K, -D]]
    )
    given = np.concatenate([np.zeros(N), arm["rest"], np.zeros(N), arm["u"] - arm["f"]])
    wanted = np.linalg.solve(
        mass - T / 2 * force, (mass + T / 2 * force) @ arm["x"].ravel() + T * given
    ).reshape(4, N)
    L, x = np.empty((N, N)), arm["x"].copy()
    assert factor_step(arm["drives"], arm["M"], T, L)
    step(arm["drives"], arm["M"], L, arm["rest"], arm["f"], arm["u"], T, x)
    assert x == pytest.approx(wanted, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(("state_hz", "disturbance_hz"), [(20.0, 20.0), (50.0, 10.0), (5.0, 80.0)])
def test_the_filter_has_the_poles_that_it_says(state_hz, disturbance_hz):
    a, b, g = filter_gains(state_hz, disturbance_hz, T)
    move = np.array([[1.0, T, T * T / 2], [0.0, 1.0, T], [0.0, 0.0, 1.0]])
    correct = np.eye(3) - np.outer([a, b / T, g / T**2], [1.0, 0.0, 0.0])
    poles = np.sort_complex(np.linalg.eigvals(move @ correct))
    wanted = np.sort([math.exp(-2 * math.pi * f * T) for f in (state_hz, state_hz, disturbance_hz)])
    assert poles.real == pytest.approx(wanted, abs=1e-5)
    assert poles.imag == pytest.approx(0.0, abs=1e-5)


def run(duration_s=2.0, **blocks):
    settings = {
        "robot.drive": {"coulomb_nm": 0.0, "torque_rate_nm_per_s": 1000.0},
        "task.duration_s": duration_s,
    }
    scenario = surgsim.load("circle_panda", controller="rcm_elastic_dynamics", settings=settings, **blocks)
    setup = prepare(scenario)
    simulation = Simulation(setup)
    simulation.run()
    memory = simulation.trace(), setup.controller.arrays["law_memory"][: ROWS * N].reshape(ROWS, N)
    return setup, *memory


def test_it_tells_the_payload_from_the_friction():
    """The weight of a payload is found on the links, dry friction of the motors on the motors."""
    setup, _, rows = run(disturbances=[{"type": "payload", "mass_kg": 0.3}])
    q = setup.plant.truth().q
    nominal = setup.arm.dynamics(q, np.zeros(N)).bias
    weight = np.array(setup.plant.data.qfrc_bias)[:N] - nominal
    assert np.abs(weight).max() > 1.0
    assert rows[LINK] == pytest.approx(-weight, abs=0.03 * np.abs(weight).max())
    assert np.abs(rows[MOTOR]).max() < 0.05


def test_without_errors_it_knows_the_motors_speed():
    _, trace, rows = run()
    assert rows[W] == pytest.approx(trace.block("motor_speed")[-1], abs=2e-3)
    assert np.abs(rows[LINK]).max() < 0.02
    assert trace["rcm_error_m"].max() < 3e-5
