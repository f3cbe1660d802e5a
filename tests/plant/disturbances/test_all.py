"""What holds for every disturbance in a scenario: the seed decides, and the plant must have dynamics."""

import numpy as np
import pytest

from surgsim.errors import ScenarioError
from surgsim.plant.disturbances import DISTURBANCES
from surgsim.simulate.loop import simulate

SPREAD = {
    "inertia_error": ", spread: 0.5",
    "joint_friction": ", spread: 0.5",
    "payload": ", spread: 0.5",
    "push": ", direction: random, start_s: 0.05, duration_s: 0.2",
}
every = pytest.mark.parametrize("name", DISTURBANCES.names())


def _list(name):
    return f"disturbances=[{{type: {name}{SPREAD.get(name, '')}}}]"


@every
def test_a_run_repeats_under_a_seed_and_differs_under_another_where_something_is_drawn(scenario, name):
    short = ("task.duration_s=0.2", "task.ramp_s=0.05")
    controller = "joint_impedance"  # stiff, and survives a delay
    first, again, other, calm = (
        simulate(scenario(*short, *changes, controller=controller, seed=seed))
        for seed, changes in ((1, [_list(name)]), (1, [_list(name)]), (2, [_list(name)]), (1, []))
    )
    assert first.equals(again)
    assert np.array_equal(first.block("q"), other.block("q")) == (name not in SPREAD)
    assert not np.array_equal(first.block("q"), calm.block("q"))


def test_each_disturbance_draws_for_itself(scenario):
    """Adding one behind does not change what another draws."""
    one = scenario(_list("payload"), seed=3).build_disturbances()
    two = scenario(
        _list("payload")[:-1] + ", {type: inertia_error, spread: 0.5}]", seed=3
    ).build_disturbances()
    assert one[0]._mass == two[0]._mass != 0.2


@every
def test_on_the_kinematic_plant_it_is_refused(scenario, name):
    with pytest.raises(ScenarioError, match="disturbances do not act on the 'kinematic' plant"):
        scenario("plant={type: kinematic}", _list(name))
