"""dm_env's own contract tests, on every shipped scenario with every kind of action."""

import unittest
from typing import get_args

import pytest
from dm_env.test_utils import EnvironmentTestMixin

from surgsim.env import load
from surgsim.env.actions import Action
from surgsim.errors import SurgsimError


def _contract(scenario, action):
    """A test case of dm_env for one environment; its episodes end within the 20 steps of its sequence."""

    class Contract(EnvironmentTestMixin, unittest.TestCase):
        def make_object_under_test(self):
            return load(scenario, action=action)

    return Contract


@pytest.mark.parametrize("action", get_args(Action))
def test_the_contract_of_dm_env_holds(shipped_name, brief_scenario, action):
    scenario = brief_scenario(shipped_name)
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
