"""Environments: what they show, take, reward and how they end."""

from typing import get_args

import numpy as np
import pytest
from dm_env import specs

from surgsim.control.policies.shipped import proportional
from surgsim.env import load
from surgsim.env.actions import Action
from surgsim.env.rewards import reward
from surgsim.errors import Outcome, SurgsimError
from surgsim.metrics.catalog import compute_metrics
from surgsim.metrics.timing import TIMING_METRICS
from surgsim.simulate.loop import simulate
from surgsim.simulate.setup import prepare

every_action = pytest.mark.parametrize("action", get_args(Action))
POLICY = "policy_proportional"
PAYLOAD = "disturbances=[{type: payload, mass_kg: 0.3, spread: 0.5}]"


def episode(environment, policy):
    """Time steps of a whole episode."""
    steps = [environment.reset()]
    while not steps[-1].last():
        steps.append(environment.step(policy(steps[-1].observation)))
    return steps


def random_policy(environment, seed, scale=1.0):
    rng, limit = np.random.default_rng(seed), environment.action_spec().maximum
    return lambda observation: scale * rng.uniform(-limit, limit)


def same(a, b):
    """Whether two episodes are equal bit for bit."""
    return len(a) == len(b) and all(
        x.reward == y.reward
        and x.discount == y.discount
        and all(np.array_equal(x.observation[name], y.observation[name]) for name in x.observation)
        for x, y in zip(a, b, strict=True)
    )


@pytest.fixture
def table(brief_scenario):
    return load(brief_scenario("circle_lwr4plus"))


def test_the_observation_is_typed_ordered_and_inside_its_bounds(table):
    spec = table.observation_spec()
    shapes = {name: item.shape for name, item in spec.items()}
    assert shapes == {
        "time": (1,),
        "joint_position": (7,),
        "joint_velocity": (7,),
        "tip_position": (3,),
        "tip_error": (3,),
        "command_velocity": (3,),
        "command_acceleration": (3,),
        "rcm_error": (2,),
        "insertion_depth": (1,),
        "trocar_position": (3,),
        "trocar_velocity": (3,),
    }
    assert all(isinstance(item, specs.BoundedArray) and item.dtype == np.float64 for item in spec.values())
    assert all(np.isfinite([*item.minimum, *item.maximum]).all() for item in spec.values())
    for step in episode(table, random_policy(table, 0)):
        assert list(step.observation) == list(spec)
        for name, item in spec.items():
            item.validate(step.observation[name])


def test_the_observation_is_what_the_run_was(table):
    steps = episode(table, proportional)
    trace, decimation = table.task.trace(), 20
    rows = [*range(0, len(trace) - 1, decimation), len(trace) - 1]
    assert len(rows) == len(steps)
    seen = {name: np.array([step.observation[name] for step in steps]) for name in steps[0].observation}
    np.testing.assert_array_equal(seen["time"][:, 0], trace["t_s"][rows])
    np.testing.assert_array_equal(seen["joint_position"], trace.block("q")[rows])
    np.testing.assert_array_equal(seen["joint_velocity"], trace.block("v")[rows])
    np.testing.assert_allclose(seen["tip_position"], trace.block("tip")[rows], atol=1e-12)
    np.testing.assert_allclose(
        np.linalg.norm(seen["tip_error"], axis=1), trace["tip_error_m"][rows], atol=1e-12
    )
    np.testing.assert_allclose(
        np.linalg.norm(seen["rcm_error"], axis=1), trace["rcm_error_m"][rows], atol=1e-12
    )
    np.testing.assert_array_equal(seen["trocar_position"], trace.block("trocar")[rows])
    depth = np.linalg.norm(trace.block("tip")[rows] - trace.block("trocar")[rows], axis=1)
    np.testing.assert_allclose(seen["insertion_depth"][:, 0], depth, atol=1e-4)
    rewards = [reward(trace["tip_error_m"][row], trace["rcm_error_m"][row]) for row in rows[1:]]
    np.testing.assert_allclose([step.reward for step in steps[1:]], rewards, rtol=1e-12)


def test_without_a_trocar_its_observations_are_absent(scenario):
    environment = load(scenario("trocar=null"))
    names = ("rcm_error", "insertion_depth", "trocar_position", "trocar_velocity")
    steps = episode(environment, proportional)
    assert not set(names) & set(environment.observation_spec())
    assert environment.task.ending.outcome is Outcome.COMPLETED
    assert steps[1].reward == reward(environment.task.trace()["tip_error_m"][20], None)


@pytest.mark.parametrize(
    ("action", "limit"),
    [("tip_velocity", [0.1] * 3), ("joint_velocity", "velocity"), ("torque", "torque")],
)
def test_actions_are_bounded_by_the_arm_s_limits(scenario, action, limit):
    environment = load(scenario(), action=action)
    spec = environment.action_spec()
    limit = (
        getattr(environment.physics.setup.scene.limits, limit) if isinstance(limit, str) else np.array(limit)
    )
    assert (spec.name, spec.dtype) == (action, np.float64)
    np.testing.assert_array_equal([spec.minimum, spec.maximum], [-limit, limit])


@every_action
def test_actions_beyond_their_bounds_are_cut_there(scenario, action):
    a, b = load(scenario(), action=action), load(scenario(), action=action)
    limit = a.action_spec().maximum
    assert same(episode(a, lambda _: limit), episode(b, lambda _: 100.0 * limit))


@every_action
@pytest.mark.parametrize("seed", range(2))
def test_a_random_policy_ends_in_an_outcome(scenario, action, seed):
    environment = load(scenario(), action=action)
    steps = episode(environment, random_policy(environment, seed))
    trace = environment.task.trace()
    assert all(0.0 <= step.reward <= 1.0 for step in steps[1:])
    assert trace.meta.ending.outcome in Outcome
    assert steps[-1].discount == (1.0 if trace.meta.ending.outcome is Outcome.COMPLETED else 0.0)
    assert np.isfinite(trace.block("q")).all()


@every_action
def test_the_same_seed_gives_the_same_episodes_bit_for_bit(scenario, action):
    def episodes(seed):
        environment = load(scenario(PAYLOAD), action=action, seed=seed)
        runs = [episode(environment, random_policy(environment, 5, 0.1)) for _ in range(2)]
        return runs, environment.task.episode_seed

    (first, second), seed = episodes(1)
    (first_again, second_again), seed_again = episodes(1)
    assert same(first, first_again)
    assert same(second, second_again)
    assert seed == seed_again
    assert not same(first, second)
    assert not same(first, episodes(2)[0][0])


def test_an_episode_can_be_simulated_again_from_its_trace(scenario):
    environment = load(scenario(PAYLOAD, controller=POLICY), decimation=1, seed=3)
    episode(environment, proportional)
    episode(environment, proportional)
    told = environment.task.trace().meta.scenario
    again = simulate(scenario(PAYLOAD, controller=POLICY, seed=told["seed"]))
    np.testing.assert_array_equal(again.block("q"), environment.task.trace().block("q"))


def test_torques_reach_the_plant_as_they_are(scenario):
    made = scenario()
    environment = load(made, action="torque", decimation=5)
    rng, limit = np.random.default_rng(0), environment.action_spec().maximum
    environment.reset()
    gravity = environment.physics.setup.arm.dynamics(environment.physics.state.q, np.zeros(7)).bias
    setup = prepare(made)
    setup.plant.reset(setup.q_start)
    for _ in range(12):
        torque = gravity + 0.01 * rng.uniform(-limit, limit)
        environment.step(torque)
        for _ in range(5):
            state = setup.plant.step(torque, np.zeros(7))
        np.testing.assert_array_equal(environment.physics.state.q, state.q)
        np.testing.assert_array_equal(environment.physics.state.v, state.v)
        np.testing.assert_array_equal(environment.physics.state.tau, torque)


def test_joint_velocities_are_followed(scenario):
    environment = load(scenario("safety.rcm_error_max_m=null"), action="joint_velocity")
    wanted = np.array([0.1, -0.1, 0.1, 0.1, -0.1, 0.1, 0.2])
    episode(environment, lambda _: wanted)
    trace = environment.task.trace()
    np.testing.assert_array_equal(trace.block("qdot_ref"), np.tile(wanted, (len(trace), 1)))
    moved = trace.block("q")[-1] - trace.block("q")[0]
    assert np.abs(moved - 0.3 * wanted).max() < 0.01


def test_a_tip_velocity_moves_the_tip_through_the_trocar(scenario):
    wanted = np.array([0.02, -0.01, -0.02])
    for resolver in ("pinv", "qp"):
        environment = load(scenario(), resolver=resolver)
        episode(environment, lambda _: wanted)
        trace = environment.task.trace()
        assert trace.meta.scenario["controller"]["resolver"]["resolver"]["type"] == resolver
        np.testing.assert_allclose(np.ptp(trace.block("tip"), axis=0), 0.3 * np.abs(wanted), atol=5e-4)
        assert trace["rcm_error_m"].max() < 4e-3


OF_EVERY_COMMAND = {
    "resolver_residual_rms",
    "torque_total_mean_nm",
    "torque_peak_nm",
    "torque_rate_ratio_max",
    "torque_rate_over_fraction",
    "torque_rate_median_nm_per_s",
}
"""Metrics that hold the last row's command too."""


@pytest.mark.parametrize("decimation", [1, 7, 20])
def test_a_policy_in_the_environment_and_in_simulate_gives_the_same_numbers(scenario, decimation):
    made = scenario(f"controller.resolver.decimation={decimation}", controller=POLICY)
    wanted = simulate(made)
    environment = load(made, decimation=decimation)
    episode(environment, proportional)
    trace = environment.task.trace()
    assert trace.columns == wanted.columns
    timing = trace.columns.index("control_time_s")
    rows, others = slice(0, -1), np.arange(len(trace.columns)) != timing
    np.testing.assert_array_equal(trace.data[rows, others], wanted.data[rows, others])
    # the last row's command never acts; the environment has no action for it and shows the one before
    for name in ("t", "q", "v", "tip", "tip_ref", "wrist", "trocar", "tip_error", "rcm_error"):
        np.testing.assert_array_equal(trace.block(name)[-1], wanted.block(name)[-1])
    ours, theirs = compute_metrics(trace), compute_metrics(wanted)
    for name in ours.keys() - TIMING_METRICS - OF_EVERY_COMMAND:
        assert ours[name] == theirs[name], name


def test_the_proportional_policy_follows_the_path():
    environment = load("circle_lwr4plus", resolver="pinv")
    steps = episode(environment, proportional)
    metrics = compute_metrics(environment.task.trace())
    assert environment.task.ending.outcome is Outcome.COMPLETED
    assert len(steps) == 551
    assert steps[-1].discount == 1.0
    assert metrics["tip_error_max_mm"] < 0.1
    assert metrics["rcm_error_max_mm"] < 5.0
    assert np.mean([step.reward for step in steps[1:]]) > 0.8


def test_a_safety_limit_ends_the_episode_with_its_name_at_the_state_that_passed_it(scenario):
    environment = load(scenario("safety.tip_error_max_m=0.001"))
    steps = episode(environment, lambda _: [0.1, 0.0, 0.0])
    ending = environment.task.ending
    assert ending.outcome is Outcome.TIP_LIMIT
    assert "limit 1.00 mm" in ending.detail
    assert (steps[-1].discount, steps[-1].step_type.name) == (0.0, "LAST")
    assert np.linalg.norm(steps[-1].observation["tip_error"]) > 1e-3
    assert all(np.linalg.norm(step.observation["tip_error"]) < 1e-3 for step in steps[:-1])
    assert environment.task.trace()["t_s"][-1] == steps[-1].observation["time"][0] == ending.t_s
    assert environment.step([0.0] * 3).first()
    assert environment.task.ending is None


def test_an_action_that_is_not_finite_ends_the_episode_as_diverged(scenario):
    environment = load(scenario())
    steps = episode(environment, lambda _: [np.nan, 0.0, 0.0])
    assert len(steps) == 2
    assert environment.task.ending.outcome is Outcome.DIVERGED
    assert "policy 'agent' gave [nan  0.  0.]" in environment.task.ending.detail


def test_a_run_that_goes_on_has_no_trace(table):
    table.reset()
    with pytest.raises(SurgsimError, match="the episode has not ended"):
        table.task.trace()


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (
            {"action": "tip_force"},
            "'tip_force' is not a kind of action. Known: joint_velocity, tip_velocity, torque",
        ),
        ({"decimation": 0}, "decimation 0 is not allowed: must be 1 or more"),
        (
            {"action": "torque", "resolver": "qp"},
            "a resolver is for tip velocities, not for the action 'torque'",
        ),
        ({"resolver": "pinvv"}, "'pinvv' is not a resolver"),
        ({"resolver": "policy"}, "resolver 'policy' asks a policy itself"),
    ],
)
def test_wrong_arguments_are_refused(scenario, options, text):
    with pytest.raises(SurgsimError, match=text):
        load(scenario(), **options)


def test_an_action_of_the_wrong_shape_is_refused(table):
    table.reset()
    with pytest.raises(SurgsimError, match=r"policy 'agent' gave an action of shape \(7,\), not \(3,\)"):
        table.step(np.zeros(7))


def test_the_kinematic_plant_takes_velocities_but_no_torques(scenario):
    made = scenario("plant.type=kinematic")
    with pytest.raises(SurgsimError, match="the 'kinematic' plant takes no torque"):
        load(made, action="torque")
    environment = load(made)
    episode(environment, proportional)
    assert environment.task.trace()["tip_error_m"].max() < 1e-3


@pytest.mark.parametrize(
    ("errors", "wanted"),
    [
        ((0.0, 0.0), 1.0),
        ((1e-3, 5e-3), 0.5),
        ((0.0, None), 1.0),
        ((1e-3, None), 0.5),
        ((np.nan, np.nan), 0.0),
    ],
)
def test_rewards_are_one_without_error_and_a_half_at_the_limits_of_convergence(errors, wanted):
    assert reward(*errors) == pytest.approx(wanted)


def test_rewards_fall_with_either_error():
    assert (
        reward(0.0, 0.0)
        > reward(1e-4, 0.0)
        > reward(1e-2, 0.0)
        > 0.5
        > reward(1e-2, 1e-2)
        > reward(1.0, 1.0)
        > 0
    )


@every_action
def test_an_episode_goes_on_from_a_state_with_the_same_bits(brief_scenario, action):
    first = load(brief_scenario("circle_lwr4plus"), action=action, seed=3)
    first.reset()
    first.step(0.1 * first.action_spec().maximum)
    state = first.get_state()

    def onward(environment):
        policy = random_policy(environment, 1, 0.1)
        steps = [environment.step(policy(None)) for _ in range(3)]
        return [*steps, *episode(environment, random_policy(environment, 2, 0.1))]

    expected = onward(first)
    other = load(brief_scenario("circle_lwr4plus"), action=action, seed=4)
    other.reset()
    for environment in (first, other):  # it has ended; or it is at the begin of another episode
        environment.set_state(state)
        assert same(onward(environment), expected)


def test_a_state_of_another_scenario_is_refused(table, brief_scenario):
    other = load(brief_scenario("circle_panda"))
    for environment in (table, other):
        environment.reset()
    with pytest.raises(SurgsimError, match=r"^circle_panda: the state is of another scenario$"):
        other.set_state(table.get_state())
