"""The admittance of the remote centre: its equation, its dead zone and bounds, a breathing wall."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lsim

import surgsim
from surgsim.control.port_estimators.admittance import PortAdmittanceConfig
from surgsim.errors import Outcome, ScenarioError
from surgsim.plant.state import Wrench
from surgsim.scenario.load import load_scenario

DT = 0.001


def _wrench(problem, force):
    """Of a force at the port."""
    return Wrench(force=force, moment=np.cross(problem.p_WC - problem.kin.p_WT, force))


def _run(arm, problem, force_of, seconds, **config):
    """Where the remote centre goes (ticks, 3) [m], and how fast, under a force (t) -> (3,) at the port."""
    estimator = PortAdmittanceConfig(**config).build(arm)
    memory, places, rates = estimator.start(problem), [], []
    for k in range(round(seconds / DT)):
        wrench = _wrench(problem, force_of(k * DT))
        estimate, memory = estimator.step(replace(problem, t_s=k * DT, wrench=wrench), memory)
        places.append(estimate.p_WC - problem.p_WC)
        rates.append(estimate.v_WC)
    return np.array(places), np.array(rates)


@pytest.mark.parametrize(("mass", "damping", "stiffness"), [(2.0, 70.0, 0.0), (1.0, 20.0, 400.0)])
def test_it_moves_as_the_mass_that_it_says(arm, problem, mass, damping, stiffness):
    """Against the state space's exact solution."""
    side = problem.kin.R_WT[:, 0]
    config = {"mass_kg": mass, "damping_n_s_per_m": damping, "stiffness_n_per_m": stiffness}
    config |= {"dead_zone_n": 0.0, "tare_s": 0.0, "most_m": 1.0}
    places, rates = _run(arm, problem, lambda t: 3.0 * np.sin(5.0 * t) * side, 1.0, **config)
    t = DT * np.arange(1, len(places) + 1)
    A = np.array([[0.0, 1.0], [-stiffness / mass, -damping / mass]])
    system = (A, np.array([[0.0], [1.0 / mass]]), np.eye(2), np.zeros((2, 1)))
    _, states, _ = lsim(system, 3.0 * np.sin(5.0 * (t - DT)), t)
    scale = np.abs(states).max(axis=0)
    np.testing.assert_allclose(places @ side, states[:, 0], atol=0.02 * scale[0])
    np.testing.assert_allclose(rates @ side, states[:, 1], atol=0.02 * scale[1])
    across = places - np.outer(places @ side, side)
    assert np.abs(across).max() < 1e-12


def test_small_forces_move_nothing_and_large_ones_less_by_the_dead_zone(arm, problem):
    side = problem.kin.R_WT[:, 1]
    still, _ = _run(arm, problem, lambda t: 0.4 * side, 0.3, dead_zone_n=0.5, tare_s=0.0)
    assert not still.any()
    moved, _ = _run(arm, problem, lambda t: 2.5 * side, 0.3, dead_zone_n=0.5, tare_s=0.0)
    same, _ = _run(arm, problem, lambda t: 2.0 * side, 0.3, dead_zone_n=0.0, tare_s=0.0)
    np.testing.assert_allclose(moved, same, atol=1e-12)


def test_a_force_that_was_there_is_taken_off_and_the_way_is_bounded(arm, problem):
    side = problem.kin.R_WT[:, 0]
    still, _ = _run(arm, problem, lambda t: 4.0 * side, 0.5, tare_s=0.1)
    assert not still.any()
    far, rates = _run(arm, problem, lambda t: 20.0 * side, 1.0, tare_s=0.0, most_m=0.01)
    assert np.linalg.norm(far, axis=1).max() == pytest.approx(0.01)
    assert np.abs(rates[-1]).max() < 1e-12


def test_a_force_on_the_tip_moves_nothing_and_no_sensor_feels_nothing(arm, problem):
    estimator = PortAdmittanceConfig(tare_s=0.0).build(arm)
    memory = estimator.start(problem)
    at_tip = replace(problem, wrench=Wrench(force=np.array([5.0, -3.0, 2.0]), moment=np.zeros(3)))
    for given in (at_tip, problem):
        for _ in range(50):
            estimate, memory = estimator.step(given, memory)
    assert np.abs(estimate.p_WC - problem.p_WC).max() < 1e-12


def test_it_follows_a_breath_that_nobody_measures():
    """The wall's force falls to an eighth: with the sensor, on ideal drives and on real ones."""
    sensor = [
        {"type": "breathing", "direction": [1.0, 0.0, 0.0], "seen": "hidden"},
        {"type": "force_torque_sensor"},
    ]
    settings = {"disturbances": sensor, "task.duration_s": 5.0}
    forces = {}
    for controller, drive in (
        ("rcm_inverse_dynamics", "ideal"),
        ("rcm_port_admittance", "ideal"),
        ("rcm_elastic_dynamics", "real"),
    ):
        own = {
            "robot.drive": drive,
            **({"controller.port": {"type": "admittance"}} if drive == "real" else {}),
        }
        run = surgsim.run("breathing_hidden_lwr4plus", controller=controller, settings=settings | own)
        assert run.trace.meta.ending.outcome is Outcome.COMPLETED
        forces[controller] = run.metrics["trocar_force_rms_n"]
    assert forces["rcm_inverse_dynamics"] > 2.0
    assert forces["rcm_port_admittance"] < 0.4
    assert forces["rcm_elastic_dynamics"] < 0.4


def test_without_a_wall_it_is_refused():
    with pytest.raises(ScenarioError, match=r"feels no wall: give trocar\.wall"):
        load_scenario("circle_lwr4plus", controller="rcm_port_admittance")
