"""The Gymnasium environments pass Gymnasium's own checker, warnings being errors."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from surgsim.env.gymnasium import SurgsimEnv, environment_id
from surgsim.scenario.load import shipped

STOP = "safety.tip_error_max_m=0.001"


def run(environment, action, seed=None):
    """Returns of a whole episode."""
    steps = [(*environment.reset(seed=seed),)]
    while len(steps[-1]) == 2 or not (steps[-1][2] or steps[-1][3]):
        steps.append(environment.step(action))
    return steps


def test_ids_are_derived_from_the_scenarios():
    assert environment_id("circle_lwr4plus") == "surgsim/Circle-LWR4Plus-v0"
    assert environment_id("circle_panda") == "surgsim/Circle-Panda-v0"
    ours = {name for name in gymnasium.registry if name.startswith("surgsim/")}
    assert ours == {environment_id(name) for name in shipped()}


def test_an_id_with_its_module_needs_no_import():
    made = gymnasium.make("surgsim.env.gymnasium:surgsim/Circle-LWR4Plus-v0")
    assert isinstance(made.unwrapped, SurgsimEnv)


def test_gymnasium_s_checker_passes(shipped_name):
    check_env(gymnasium.make(environment_id(shipped_name)).unwrapped)


@pytest.mark.parametrize("action", ["joint_velocity", "torque"])
def test_gymnasium_s_checker_passes_with_other_actions(action):
    check_env(gymnasium.make("surgsim/Circle-LWR4Plus-v0", action=action).unwrapped)


def test_the_task_s_end_truncates(scenario):
    *_, (observation, reward, terminated, truncated, info) = run(SurgsimEnv(scenario()), np.zeros(3))
    assert (terminated, truncated, info["outcome"], info["detail"]) == (False, True, "completed", "")
    assert observation["time"] == pytest.approx(0.3)
    assert 0.0 < reward < 1.0
    assert info["tip_error_mm"] < 1.0


def test_a_safety_limit_terminates_with_its_name(scenario):
    _, *between, last = run(SurgsimEnv(scenario(STOP)), np.array([1.0, 0.0, 0.0]))
    _, _, terminated, truncated, info = last
    assert (terminated, truncated, info["outcome"]) == (True, False, "tip_limit")
    assert "limit 1.00 mm" in info["detail"]
    assert info["tip_error_mm"] > 1.0
    assert all(step[4]["outcome"] == "running" for step in between)


def test_stepping_without_an_episode_is_refused(scenario):
    environment = SurgsimEnv(scenario(STOP))
    with pytest.raises(gymnasium.error.ResetNeeded):
        environment.step(np.zeros(3))
    run(environment, np.array([1.0, 0.0, 0.0]))
    with pytest.raises(gymnasium.error.ResetNeeded):
        environment.step(np.zeros(3))


def test_actions_are_scaled_to_the_bounds(scenario):
    environment = SurgsimEnv(scenario(), action="joint_velocity")
    run(environment, np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5]))
    trace = environment.environment.task.trace()
    half = 0.5 * environment.environment.action_spec().maximum[6]
    np.testing.assert_array_equal(trace["qdot_ref7_rad_per_s"], half)


def test_reset_seeds_the_scenario(scenario):
    made = scenario("disturbances=[{type: payload, mass_kg: 0.3, spread: 0.5}]")
    environment, action = SurgsimEnv(made), np.full(3, 0.1)
    ends = {seed: run(environment, action, seed)[-1][0]["joint_position"] for seed in (1, 2)}
    np.testing.assert_array_equal(run(environment, action, 1)[-1][0]["joint_position"], ends[1])
    assert not np.array_equal(ends[1], ends[2])
    assert not np.array_equal(run(environment, action)[-1][0]["joint_position"], ends[1])


def test_environments_can_be_vectorised(scenario):
    kwargs = {"assignments": ["theatre=false", "task.duration_s=2"]}
    vector = gymnasium.make_vec("surgsim/Circle-LWR4Plus-v0", num_envs=2, vectorization_mode="sync", **kwargs)
    observation, _ = vector.reset(seed=0)
    assert observation["joint_position"].shape == (2, 7)
    _, reward, *_ = vector.step(np.zeros((2, 3)))
    assert reward.shape == (2,)
    vector.close()
