"""Drawn scenarios: the same for the same seed for ever, all around the arm, and named like shipped ones."""

import numpy as np
import pytest

from surgsim.compare.suite import SuiteConfig, check_runs, expand, load_suite
from surgsim.errors import ScenarioError
from surgsim.models.folders import robot_names
from surgsim.scenario.drawn import drawn_names
from surgsim.scenario.load import load_scenario

MANY = range(200)


@pytest.fixture(scope="module")
def many():
    """The scenarios of many seeds."""
    return [load_scenario("random_panda", seed=seed) for seed in MANY]


def depth(scenario):
    return float(np.linalg.norm(np.subtract(scenario.task.start_m, scenario.trocar.position_m)))


def test_what_seed_17_draws_is_frozen():
    drawn = load_scenario("random_panda_17")
    assert (drawn.name, drawn.seed, drawn.robot.name) == ("random_panda", 17, "panda")
    assert drawn.trocar.position_m == (-0.5179, -0.2426, 0.2417)
    assert drawn.trocar.axis == (0.363576, 0.12448, 0.92321)
    assert drawn.task.start_m == (-0.5872, -0.2663, 0.0657)
    assert (drawn.task.type, drawn.task.length_m, drawn.task.duration_s) == ("sinusoid", 0.0307, 4.77)
    assert [each.type for each in drawn.disturbances] == ["payload", "joint_friction", "inertia_error"]


def test_a_seed_in_the_name_is_that_of_the_option_and_another_one_is_refused():
    named, given = load_scenario("random_lwr4plus_5"), load_scenario("random_lwr4plus", seed=5)
    assert named == given == load_scenario("random_lwr4plus_5", seed=5)
    assert load_scenario("random_lwr4plus") == load_scenario("random_lwr4plus_0")
    with pytest.raises(ScenarioError, match=r"^--seed: 6 is another than that of 'random_lwr4plus_5'"):
        load_scenario("random_lwr4plus_5", seed=6)


def test_the_resolved_scenario_is_the_scenario():
    drawn = load_scenario("random_panda_17")
    assert load_scenario(drawn.resolved()) == drawn


def test_a_robot_whose_name_ends_in_a_number_is_told_from_a_seed():
    assert load_scenario("random_test_arm_6").robot.name == "test_arm_6"
    drawn = load_scenario("random_test_arm_6_3")
    assert (drawn.robot.name, drawn.seed) == ("test_arm_6", 3)


def test_an_unknown_robot_is_refused_with_the_nearest():
    with pytest.raises(ScenarioError, match=r"'random_pandas_1' is not a drawn scenario.*random_panda"):
        load_scenario("random_pandas_1")


def test_settings_and_controllers_apply_to_drawn_ones():
    drawn = load_scenario("random_panda_1", controller="vprnn", assignments=["task.duration_s=3"])
    assert (drawn.controller.name, drawn.task.duration_s) == ("vprnn", 3.0)


def test_ports_lie_all_around_the_arm_and_values_over_their_ranges(many):
    position = np.array([each.trocar.position_m for each in many])
    quarter = np.floor(np.arctan2(position[:, 1], position[:, 0]) / (0.5 * np.pi)).astype(int)
    assert np.bincount(quarter + 2, minlength=4).min() > 30
    tilt = np.rad2deg(np.arccos([each.trocar.axis[2] for each in many]))
    assert 0.0 <= tilt.min() < 2.0
    assert 23.0 < tilt.max() <= 25.0
    depths = [depth(each) for each in many]
    assert 0.0699 < min(depths) < 0.08
    assert 0.19 < max(depths) < 0.2001
    assert {each.task.type for each in many} == {"circle", "sinusoid", "spiral"}
    durations = [each.task.duration_s for each in many]
    assert 2.5 <= min(durations) < 2.6
    assert 4.9 < max(durations) <= 5.0


def test_every_shipped_arm_has_its_drawn_scenarios():
    assert list(drawn_names()) == [f"random_{robot}" for robot in robot_names()]
    for name in drawn_names():
        assert load_scenario(name).description == drawn_names()[name]


def test_the_suite_draws_one_scenario_for_each_seed_the_same_for_all_controllers():
    suite, folder = load_suite("random")
    assert set(suite.scenarios) <= set(drawn_names())
    changed = SuiteConfig(**{**suite.model_dump(), "seeds": "3,4", "controllers": ("pinv", "qp")})
    specs = expand(changed, folder)
    places = {}
    for spec, scenario in zip(specs, check_runs(specs), strict=True):
        assert scenario.seed == spec.seed
        places.setdefault((spec.scenario, spec.seed), set()).add(scenario.trocar.position_m)
    assert len(places) == 4
    assert all(len(each) == 1 for each in places.values())
    assert len(set.union(*places.values())) == 2, "both arms have the ports of the seeds"
