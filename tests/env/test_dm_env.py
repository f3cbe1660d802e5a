"""dm_env's own contract tests: every shipped scenario with a kind of action, every kind with some."""

import unittest
from typing import get_args

import pytest
from dm_env.test_utils import EnvironmentTestMixin

from surgsim.env import load
from surgsim.env.actions import Action
from surgsim.errors import SurgsimError
from surgsim.scenario.load import of_one_arm, shipped


def _contract(scenario, action):
    """A test case of dm_env for one environment; its episodes end within the 20 steps of its sequence."""

    class Contract(EnvironmentTestMixin, unittest.TestCase):
        def make_object_under_test(self):
            return load(scenario, action=action)

    return Contract


ACTIONS = get_args(Action)
NAMES = of_one_arm(shipped())


def test_the_contract_of_dm_env_holds_on_every_scenario(shipped_name, brief_scenario):
    """The kinds of action take turns: what a scenario has and what an action does are two things."""
    keeps_the_contract(brief_scenario(shipped_name), ACTIONS[NAMES.index(shipped_name) % len(ACTIONS)])


@pytest.mark.parametrize("action", ACTIONS)
@pytest.mark.parametrize("name", ["circle_iiwa14", "theatre_fr3", "teleop_wall_lwr4plus"])
def test_the_contract_of_dm_env_holds_with_every_kind_of_action(brief_scenario, name, action):
    keeps_the_contract(brief_scenario(name), action)


def test_every_kind_of_action_has_its_turn():
    turns = {ACTIONS[NAMES.index(name) % len(ACTIONS)] for name in NAMES}
    assert turns == set(ACTIONS)


def keeps_the_contract(scenario, action):
    """Run dm_env's tests; a plant that takes no torque must refuse that kind of action."""
    if action == "torque" and not scenario.plant.uses_torque:
        with pytest.raises(SurgsimError, match="torque"):
            load(scenario, action=action)
        return
    suite = unittest.defaultTestLoader.loadTestsFromTestCase(_contract(scenario, action))
    assert suite.countTestCases() >= 4
    result = unittest.TestResult()
    suite.run(result)
    assert result.testsRun == suite.countTestCases()
    assert [trace for _, trace in result.failures + result.errors] == []


def test_the_contract_catches_an_environment_that_breaks_it(scenario):
    suite = unittest.defaultTestLoader.loadTestsFromTestCase(_contract(scenario(), "torque"))
    for case in suite:
        make = case.make_object_under_test

        def broken(make=make):
            environment = make()
            environment.task.get_reward = lambda physics: "much"
            return environment

        case.make_object_under_test = broken
    result = unittest.TestResult()
    suite.run(result)
    assert result.failures + result.errors
