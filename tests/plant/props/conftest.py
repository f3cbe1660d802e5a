"""A scenario with a peg board, and a task that goes through its goals."""

from dataclasses import replace

import numpy as np
import pytest

from surgsim.models.peg_board import transfer_goals
from surgsim.plant.props.peg_board import PegBoardConfig
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import prepare
from surgsim.tasks.base import TimedTask, TipCommand

SPEED_M_PER_S = 0.06


class Transfer(TimedTask):
    """Minimum-jerk moves from goal to goal, each followed by the goal's dwell."""

    def __init__(self, start, goals):
        self.moves = []
        t, place = 0.0, np.array(start)
        for goal in goals:
            target = goal.position
            took = max(0.2, 1.875 * float(np.linalg.norm(target - place)) / SPEED_M_PER_S)
            took = took if np.linalg.norm(target - place) > 0.0 else 0.01
            self.moves.append((t, took, place, target, goal.jaw))
            t, place = t + took + goal.dwell_s, target
        self._duration = t + 0.3

    @property
    def duration_s(self):
        return self._duration

    def command(self, t_s, feedback=None):
        current = [move for move in self.moves if move[0] <= t_s + 1e-9][-1]
        begin, took, place, target, jaw = current
        before = [move[4] for move in self.moves if move[0] < begin]
        x = min(max((t_s - begin) / took, 0.0), 1.0)
        way = target - place
        return TipCommand(
            p_WTd=place + way * x**3 * (10.0 - 15.0 * x + 6.0 * x * x),
            v_WTd=way * 30.0 * x * x * (1.0 - x) ** 2 / took,
            a_WTd=way * 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / took**2,
            jaw=jaw if x >= 1.0 else (before[-1] if before else 0.0),
        )


@pytest.fixture(scope="session")
def board_scenario():
    """Factory: the Panda's circle scenario with a peg board and our torque law; keys are the board's."""

    def make(assignments=(), **keys):
        scenario = load_scenario(
            "circle_panda", controller="rcm_inverse_dynamics", assignments=("theatre=false", *assignments)
        )
        return scenario.model_copy(update={"props": (PegBoardConfig(**keys),)})

    return make


@pytest.fixture(scope="session")
def transfer():
    """Factory: a simulation of a board's scenario under the scripted task, with its goals."""

    def make(scenario, goals=None):
        goals = transfer_goals(scenario.props[0]) if goals is None else goals
        task = Transfer(scenario.task.start_m, goals)
        return Simulation(replace(prepare(scenario), task=task))

    return make
