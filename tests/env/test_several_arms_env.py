"""An agent drives one of several arms; the others have their own controllers."""

import copy

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from surgsim.control.policies.shipped import proportional
from surgsim.env import load
from surgsim.env.gymnasium import SurgsimEnv
from surgsim.errors import Outcome, SurgsimError
from surgsim.metrics.catalog import compute_metrics
from surgsim.scenario.load import load_experiment, load_scenario
from surgsim.simulate.loop import simulate

SHORT = {"duration_s": 0.2, "ramp_s": 0.1, "hold_start_s": 0.0, "hold_end_s": 0.0, "radius_m": 0.002}


def scenario(*more, of="two_ports_panda"):
    """Two arms with short tasks, the right one's 0.1 s longer."""
    words = [f"arms.{k}.task.{key}={value}" for k in (0, 1) for key, value in SHORT.items()]
    settings = ("theatre=false", *words, "arms.1.task.duration_s=0.3", *more)
    return load_experiment(of, assignments=settings)


def episode(environment, policy):
    steps = [environment.reset()]
    while not steps[-1].last():
        steps.append(environment.step(policy(steps[-1].observation)))
    return steps


def test_the_agent_drives_its_arm_and_the_other_does_what_it_did_without_it():
    environment = load(scenario(), arm="left", resolver="pinv", seed=3)
    steps = episode(environment, proportional)
    trace, ending = environment.task.trace(), environment.task.ending
    assert ending.outcome is Outcome.COMPLETED
    assert (steps[-1].discount, len(steps)) == (1.0, 1 + 15)
    assert trace["t_s"][-1] == pytest.approx(0.3)
    rows = [*range(0, len(trace) - 1, 20), len(trace) - 1]
    seen = np.array([step.observation["joint_position"] for step in steps])
    np.testing.assert_array_equal(seen, trace.of("left").block("q")[rows])
    assert trace.meta.scenario["arms"][0]["controller"]["name"] == "agent"
    own = simulate(scenario()).of("right")
    for block in ("q", "tau", "tip"):
        np.testing.assert_allclose(trace.of("right").block(block), own.block(block), rtol=0.0, atol=1e-9)
    assert trace.meta.scenario["seed"] == environment.task.episode_seed
    assert compute_metrics(trace)["left_tip_error_max_mm"] < 2.0


def test_what_an_agent_did_its_policy_does_in_a_run():
    environment = load(scenario(), arm="right", resolver="qp", decimation=10)
    episode(environment, proportional)
    trace = environment.task.trace()
    tree = copy.deepcopy(dict(trace.meta.scenario))
    tree["arms"][1]["controller"]["resolver"]["name"] = "proportional"
    run = simulate(load_experiment(tree))
    for block in ("q", "tip", "tau"):
        mine, its = (one.of("right").block(block) for one in (trace, run))
        np.testing.assert_array_equal(mine[:-1], its[:-1])  # the last command never acts


def test_contact_between_arms_ends_the_episode_with_the_state_that_has_it():
    whole = load_experiment("safety/arm_collision", assignments=["theatre=false"])
    environment = load(whole, arm="left")
    steps = episode(environment, lambda seen: seen["command_velocity"] - 5.0 * seen["tip_error"])
    assert environment.task.ending.outcome is Outcome.ARM_COLLISION
    assert steps[-1].discount == 0.0
    last = environment.task.trace().of("left").block("q")[-1]
    np.testing.assert_array_equal(steps[-1].observation["joint_position"], last)


def test_another_arm_s_outcome_ends_the_episode():
    limit = "arms.1.safety={tip_error_max_m: 1.0e-9}"
    environment = load(scenario(limit), arm="left")
    steps = episode(environment, proportional)
    assert environment.task.ending.outcome is Outcome.TIP_LIMIT
    assert environment.task.ending.detail.startswith("arm right: ")
    assert steps[-1].discount == 0.0


def test_a_state_is_taken_and_put_back():
    environment = load(scenario(), arm="left", seed=5)
    environment.reset()
    for _ in range(4):
        environment.step(np.array([0.01, 0.0, -0.01]))
    state = environment.get_state()
    first = [environment.step(np.array([0.0, 0.02, 0.0])).observation["joint_position"] for _ in range(3)]
    environment.set_state(state)
    again = [environment.step(np.array([0.0, 0.02, 0.0])).observation["joint_position"] for _ in range(3)]
    np.testing.assert_array_equal(first, again)


def test_gymnasium_s_checker_passes():
    check_env(gymnasium.make("surgsim/Two-Ports-Panda-v0", arm="right", action="joint_velocity").unwrapped)
    made = SurgsimEnv("endoscope_and_tool_panda", arm="tool")
    assert made.action_space.shape == (3,)


def test_which_arm_it_is_must_be_said():
    with pytest.raises(SurgsimError, match="two_ports_panda has the arms left, right: say by arm which one"):
        gymnasium.make("surgsim/Two-Ports-Panda-v0")
    with pytest.raises(SurgsimError, match=r"'top' is not an arm of this scenario\. Known: "):
        load("two_ports_panda", arm="top")
    with pytest.raises(SurgsimError, match="circle_panda has one arm: leave out arm, 'left'"):
        load(load_scenario("circle_panda"), arm="left")
