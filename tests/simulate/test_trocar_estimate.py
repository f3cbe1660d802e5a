"""The recorded estimate of the trocar is the estimator's, whatever point the shaft is held through."""

from dataclasses import replace

import numpy as np
import pytest

from surgsim.control.port_estimators.base import PortEstimate
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import prepare

TRACKING = ("controller.port={type: tracking}", "disturbances=[]")


class Watching:
    """A port estimator in Python that takes the trocar as it is seen, and keeps that."""

    def __init__(self):
        self.seen = []

    def start(self, problem):
        return None

    def step(self, problem, memory):
        self.seen.append(problem.p_WC)
        return PortEstimate(p_WC=problem.p_WC, v_WC=problem.v_WC, a_WC=np.zeros(3)), None


def first_ticks(simulation):
    for _ in range(5):
        simulation.tick()
    return simulation.trace()


def test_a_shift_of_the_remote_centre_is_not_in_the_recorded_estimate():
    setup = prepare(load_scenario("insertion_lwr4plus", controller="pinv", assignments=TRACKING))
    simulation = Simulation(setup)
    shift = setup.controller.control.command.rcm_shift.copy()
    assert np.linalg.norm(shift) > 0.1  # else nothing is shown
    trace = first_ticks(simulation)
    apart = np.linalg.norm(trace.block("trocar_estimate") - trace.block("trocar"), axis=1)
    assert apart.max() < 1e-9


def test_an_estimator_sees_the_measured_trocar_and_the_resolver_the_shifted_one(asking):
    setup = prepare(load_scenario("insertion_lwr4plus", controller="pinv", assignments=TRACKING))
    estimator, resolved = Watching(), []
    setup = asking(setup, lambda tick, problem: resolved.append(problem.p_WC))
    parts = replace(setup.controller.parts, port=estimator)
    setup = replace(setup, controller=setup.controller.with_parts(parts))
    simulation = Simulation(setup)
    trace = first_ticks(simulation)
    shift = setup.controller.control.command.rcm_shift
    assert np.array_equal(np.array(estimator.seen), trace.block("trocar"))
    assert resolved[-1] - estimator.seen[-1] == pytest.approx(shift, abs=1e-4)
