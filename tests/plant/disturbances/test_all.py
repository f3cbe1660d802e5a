"""What holds for every disturbance in a scenario: the seed decides, and the plant must have dynamics."""

import itertools

import numpy as np
import pytest

from surgsim.env import load
from surgsim.errors import Outcome, ScenarioError
from surgsim.plant.disturbances import DISTURBANCES
from surgsim.simulate.loop import Simulation, simulate
from surgsim.simulate.setup import prepare

SPREAD = {
    "actuation_delay": ", jitter_s: 0.003",
    "breathing": ", random_phase: true, spread: 0.5",
    "calibration_error": "",
    "force_torque_sensor": "",
    "gravity_error": ", direction: random, spread: 0.5",
    "guiding_hand": "",
    "inertia_error": ", spread: 0.5",
    "instrument_tracker": "",
    "joint_friction": ", spread: 0.5",
    "late_ticks": ", probability: 0.2",
    "payload": ", spread: 0.5",
    "push": ", direction: random, start_s: 0.05, duration_s: 0.2",
    "sensor_noise": "",
    "tissue": ", spread: 0.5",
    "torque_bias": ", signs: random, spread: 0.5",
    "trocar_calibration": ", direction: random, spread: 0.5",
}
"""What makes each draw something; the others draw nothing."""
MEASURED = ("force_torque_sensor", "instrument_tracker", "sensor_delay", "sensor_noise", "trocar_calibration")
"""Those that change what is measured and nothing else."""
ONCE = "bending_shaft"
"""A shaft has one tube; a second one is refused."""
every = pytest.mark.parametrize("name", DISTURBANCES.names())
SHORT = ("task.duration_s=0.2", "task.ramp_s=0.05")


def _item(name):
    return f"{{type: {name}{SPREAD.get(name, '')}}}"


def _uses(name):
    """What lets a controller use what is measured."""
    return {
        "instrument_tracker": ["controller.instrument={type: tracked}"],
        "force_torque_sensor": ["controller.resolver={type: hands_on, dead_zone_n: 0, tare_s: 0}"],
    }.get(name, [])


def _seen(state):
    """What is measured of joints, port and instrument."""
    force = np.full(3, np.nan) if state.wrench is None else state.wrench.force
    return np.concatenate((state.q, state.p_WC, [state.tracked.samples], state.tracked.p_WT, force))


def _list(*names):
    return f"disturbances=[{', '.join(map(_item, names))}]"


@every
def test_a_run_repeats_under_a_seed_and_differs_under_another_where_something_is_drawn(scenario, name):
    controller = "joint_impedance"  # stiff, and survives a delay
    first, again, other, calm = (
        simulate(
            scenario(*SHORT, *changes, *(_uses(name) if changes else ()), controller=controller, seed=seed)
        )
        for seed, changes in ((1, [_list(name)]), (1, [_list(name)]), (2, [_list(name)]), (1, []))
    )
    assert first.equals(again)
    assert np.array_equal(first.block("q"), other.block("q")) == (name not in SPREAD)
    assert not np.array_equal(first.block("q"), calm.block("q"))


@every
def test_a_second_run_of_the_same_plant_is_the_first_again(scenario, name):
    setup = prepare(scenario(*SHORT, _list(name), *_uses(name), controller="joint_impedance", seed=4))
    first, again = Simulation(setup).run(), Simulation(setup).run()
    assert first.equals(again)


@every
def test_the_plant_moves_as_without_those_that_only_change_what_is_measured(scenario, name):
    """Under the same torques."""
    plants = [prepare(scenario(*changes, seed=1)) for changes in ([_list(name)], [])]
    for setup in plants:
        setup.plant.reset(setup.q_start)
    commands = np.random.default_rng(0).uniform(-1.0, 1.0, (100, 7))
    bias = plants[1].arm.dynamics(plants[1].q_start, np.zeros(7)).bias
    for command in commands:
        told, plain = (setup.plant.step(bias + command, np.zeros(7)) for setup in plants)
    truths = [setup.plant.truth() for setup in plants]
    same = all(np.array_equal(getattr(truths[0], key), getattr(truths[1], key)) for key in ("q", "p_WC"))
    assert same == (name in MEASURED)
    if name in MEASURED:
        assert not np.array_equal(_seen(told), _seen(plain), equal_nan=True)


@pytest.mark.parametrize("name", sorted(set(DISTURBANCES.names()) - {ONCE}))
def test_it_may_come_twice(scenario, name):
    short = ("task.duration_s=0.1", "task.ramp_s=0.03", *_uses(name))
    twice = simulate(scenario(*short, _list(name, name), seed=1))
    once = simulate(scenario(*short, _list(name), seed=1))
    assert np.isfinite(twice.block("q")).all()
    assert twice.equals(once) == (name == "torque_quantisation")  # twice the same rounding


def test_each_disturbance_draws_for_itself(scenario):
    """Adding one behind does not change what another draws."""
    one = scenario(_list("payload"), seed=3).build_parts()
    two = scenario(_list("payload", "inertia_error"), seed=3).build_parts()
    assert one[0]._mass == two[0]._mass != 0.2


MILD = {
    "actuation_delay": "{type: actuation_delay, delay_s: 0.001, jitter_s: 0.001}",
    "late_ticks": "{type: late_ticks}",
    "sensor_delay": "{type: sensor_delay, delay_s: 0.001}",
}
"""Delays that a stiff controller survives together."""


def _everything(scenario, seed):
    items = [MILD.get(name, _item(name)) for name in DISTURBANCES.names()]
    every = f"disturbances=[{', '.join(items)}]"
    return scenario(*SHORT, every, controller="joint_impedance", seed=seed)


def test_all_of_them_at_once_run_and_repeat(scenario):
    first, again, other = (simulate(_everything(scenario, seed)) for seed in (1, 1, 2))
    for trace in (first, other):
        assert trace.meta.ending.outcome is Outcome.COMPLETED
        assert np.isfinite(trace.block("q")).all()
        assert np.isfinite(trace.block("trocar")).all()
    assert first.equals(again)
    assert not first.equals(other)


def test_those_that_draw_nothing_may_stand_in_any_order(scenario):
    """The chains of torques and measurements have an order of their own."""
    fixed = (
        "{type: torque_bias}",
        "{type: torque_quantisation}",
        "{type: actuation_delay}",
        "{type: sensor_delay}",
        "{type: trocar_calibration}",
        "{type: breathing, seen: hidden, rate_hz: 2.0}",
        "{type: sensor_noise, position_std_rad: 0.0, velocity_std_rad_per_s: 0.0, position_bits: 16, "
        "torque_std_nm: 0.0, tip_force_std_n: 0.0}",
    )
    orders = [fixed, fixed[::-1], *itertools.islice(itertools.permutations(fixed), 1000, 5000, 1700)]
    traces = [
        simulate(scenario(*SHORT, f"disturbances=[{', '.join(order)}]", controller="joint_impedance"))
        for order in orders
    ]
    for trace in traces[1:]:
        np.testing.assert_array_equal(trace.block("q"), traces[0].block("q"))


@pytest.mark.parametrize("name", ["sensor_noise", "sensor_delay"])
def test_controllers_and_environments_see_what_is_measured(scenario, asking, name):
    short = scenario(*SHORT, _list(name), controller="joint_impedance")
    seen = []
    trace = Simulation(asking(prepare(short), lambda tick, problem: seen.append(problem.q))).run()
    assert (np.array(seen)[50:] != trace.block("q")[50 : len(seen)]).any(axis=1).all()

    environment = load(short, action="torque")
    step = environment.reset()
    for _ in range(20):
        step = environment.step(environment.action_spec().generate_value() * 0.0)
    physics = environment.physics
    np.testing.assert_array_equal(step.observation["joint_position"], physics.state.q)
    assert (physics.state.q != physics.setup.plant.truth().q).any()


@every
def test_on_the_kinematic_plant_it_is_refused(scenario, name):
    with pytest.raises(ScenarioError, match="disturbances do not act on the 'kinematic' plant"):
        scenario("plant={type: kinematic}", _list(name))
