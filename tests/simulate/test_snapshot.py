"""A run that is stored, restored or forked goes on with the same bits."""

import pickle
from typing import get_type_hints

import numpy as np
import pytest

from surgsim.control.controller import ControllerConfig
from surgsim.control.policies.registry import offering
from surgsim.errors import SurgsimError
from surgsim.plant.part import BLOCK_TICKS
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import prepare

SHORT = ("task.duration_s=1", "task.ramp_s=0.2", "task.hold_start_s=0.1", "task.hold_end_s=0.1")
LONG = ("task.duration_s=5", "task.ramp_s=0.2", "task.hold_start_s=0.1", "task.hold_end_s=0.1")
DRAWN = ("disturbances=[{type: sensor_noise}, {type: actuation_delay, delay_s: 0.001, jitter_s: 0.001}]",)
CONTROLLERS = ("pinv", "gradient", "rnn", "vprnn", "qp", "passive_convex", "rcm_inverse_dynamics", "mink")
CONTROLLERS += ("self_motion", "policy_proportional")


def _begun(scenario, ticks):
    simulation = Simulation(prepare(scenario))
    for _ in range(ticks):
        simulation.tick()
    return simulation


def _rest(simulation, ticks):
    """The rows that follow, but for the time that the controller took."""
    for _ in range(ticks):
        simulation.tick()
    trace = simulation.trace()
    kept = [k for k, name in enumerate(trace.columns) if name != "control_time_s"]
    return trace.data[:, kept]


def _same(a, b):
    np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("ticks", [0, 1, 137])
@pytest.mark.parametrize("controller", CONTROLLERS)
def test_a_circle_goes_on_with_the_same_bits(controller, ticks):
    simulation = _begun(load_scenario("circle_panda", controller=controller, assignments=SHORT), ticks)
    taken = pickle.loads(pickle.dumps(simulation.snapshot()))
    fork = simulation.fork()
    expected = _rest(simulation, 60)
    _same(_rest(fork, 60), expected)
    simulation.restore(taken)
    assert simulation.time_s == taken.t_s
    _same(_rest(simulation, 60), expected)


TRACKED = (
    "controller.instrument={type: tracked}",
    "disturbances=[{type: calibration_error}, {type: instrument_tracker, delay_s: 0.02, dropout: 0.3}]",
)


@pytest.mark.parametrize(
    ("controller", "drive"),
    [("rcm_inverse_dynamics", "ideal"), ("mink", "ideal"), ("rcm_elastic_dynamics", "real")],
)
def test_a_tracked_instrument_goes_on_with_the_same_bits(controller, drive):
    assignments = (*SHORT, *TRACKED, f"robot.drive={drive}")
    simulation = _begun(load_scenario("circle_panda", controller=controller, assignments=assignments), 137)
    taken = pickle.loads(pickle.dumps(simulation.snapshot()))
    fork = simulation.fork()
    expected = _rest(simulation, 60)
    assert np.ptp(expected, axis=0).any()
    _same(_rest(fork, 60), expected)
    simulation.restore(taken)
    _same(_rest(simulation, 60), expected)


@pytest.mark.parametrize(
    ("name", "ticks"), [("theatre_panda", 200), ("peg_and_ring_panda", 150), ("teleop_wall_panda", 150)]
)
def test_everything_at_once_goes_on_with_the_same_bits(name, ticks):
    simulation = _begun(load_scenario(name), ticks)
    fork, taken = simulation.fork(), simulation.snapshot()
    expected = _rest(simulation, 100)
    _same(_rest(fork, 100), expected)
    simulation.restore(taken)
    _same(_rest(simulation, 100), expected)


@pytest.mark.parametrize("ticks", [0, BLOCK_TICKS - 1, BLOCK_TICKS])
def test_what_is_drawn_in_blocks_is_drawn_again_after_a_restore(ticks):
    scenario = load_scenario("circle_panda", controller="pinv", assignments=(*LONG, *DRAWN))
    simulation = _begun(scenario, ticks)
    fork, taken = simulation.fork(), simulation.snapshot()
    expected = _rest(simulation, BLOCK_TICKS + 76)
    _same(_rest(fork, BLOCK_TICKS + 76), expected)
    simulation.restore(taken)
    _same(_rest(simulation, BLOCK_TICKS + 76), expected)


def test_a_fork_goes_its_own_way_and_leaves_the_first_alone():
    scenario = load_scenario("circle_panda", controller="pinv", assignments=SHORT)
    undisturbed, simulation = _begun(scenario, 50), _begun(scenario, 50)
    fork = simulation.fork()
    fork._setup.plant.data.qvel[:] += 0.01
    assert not np.array_equal(_rest(fork, 50), _rest(undisturbed, 50))
    _same(_rest(simulation, 50), _rest(undisturbed, 0))


class Counting:
    """A policy with a memory: it turns round every tenth time that it is asked."""

    def __init__(self):
        self.asked, self.random, self.lately = 0, np.random.default_rng(1), []

    def __call__(self, observation):
        self.asked += 1
        self.lately = [*self.lately[-3:], self.random.normal(size=3)]
        return 1e-3 * (-1.0) ** (self.asked // 10) * sum(self.lately)


POLICY = {
    "name": "asked",
    "resolver": {"type": "policy", "name": "counting"},
    "torque_law": {"type": "joint_impedance"},
}


@pytest.mark.parametrize(
    ("decimation", "asked", "asked_at_the_end"),
    [(1, 33, 83), (7, 5, 12)],
    ids=["each tick", "in the midst of a hold"],
)
def test_a_policy_in_python_goes_on_where_it_was(decimation, asked, asked_at_the_end):
    resolver = {**POLICY["resolver"], "decimation": decimation}
    config = ControllerConfig.model_validate({**POLICY, "resolver": resolver})
    with offering("counting", policy := Counting()):
        scenario = load_scenario("circle_panda", controller=config, assignments=SHORT)
        simulation = _begun(scenario, 33)
        taken = pickle.loads(pickle.dumps(simulation.snapshot()))
        expected = _rest(simulation, 50)
        assert policy.asked == asked_at_the_end
        simulation.restore(taken)
        assert policy.asked == asked
        _same(_rest(simulation, 50), expected)
        assert policy.asked == asked_at_the_end


HOLDING = {
    "tip velocity": {"resolver": {"type": "policy", "decimation": 7}, "torque_law": POLICY["torque_law"]},
    "over mink": {
        "resolver": {"type": "policy", "decimation": 7, "resolver": {"type": "mink"}},
        "torque_law": POLICY["torque_law"],
    },
    "joint velocity": {
        "resolver": {"type": "policy", "name": "wave", "action": "joint_velocity", "decimation": 7},
        "torque_law": POLICY["torque_law"],
    },
    "torque": {
        "resolver": {"type": "pinv"},
        "torque_law": {"type": "policy", "name": "wave", "decimation": 7},
    },
}


def _wave(observation):
    return 0.05 * np.sin(30.0 * observation["time"] + np.arange(7))


@pytest.mark.parametrize("ticks", [34, 35, 36])
@pytest.mark.parametrize("parts", HOLDING.values(), ids=HOLDING)
def test_a_fork_holds_the_action_that_was_held(parts, ticks):
    config = ControllerConfig.model_validate({"name": "holding", **parts})
    with offering("wave", _wave):
        simulation = _begun(load_scenario("circle_panda", controller=config, assignments=SHORT), ticks)
        fork, taken = simulation.fork(), simulation.snapshot()
        expected = _rest(simulation, 30)
        _same(_rest(fork, 30), expected)
        simulation.restore(taken)
        _same(_rest(simulation, 30), expected)


def test_a_part_that_cannot_be_copied_is_named():
    with offering("counting", policy := Counting()):
        scenario = load_scenario(
            "circle_panda", controller=ControllerConfig.model_validate(POLICY), assignments=SHORT
        )
        simulation = _begun(scenario, 1)
        policy.stream = (k for k in range(9))
        with pytest.raises(
            SurgsimError,
            match=r"^controller\.resolver: a run with it cannot be stored, its state cannot be copied: ",
        ):
            simulation.snapshot()


def test_a_snapshot_of_another_scenario_is_refused():
    one = _begun(load_scenario("circle_panda", controller="pinv", assignments=SHORT), 1)
    other = _begun(load_scenario("circle_panda", controller="qp", assignments=SHORT), 1)
    with pytest.raises(SurgsimError, match=r"^circle_panda: the snapshot is of another scenario$"):
        other.restore(one.snapshot())


def test_every_address_in_a_record_is_known_as_one():
    simulation = _begun(load_scenario("theatre_panda"), 1)

    def addresses(record, kind):
        for name in record.dtype.names:
            value = record[name]
            if name in kind.ADDRESSES:
                assert value == 0 or value > 2**20
            elif isinstance(value, np.int64):
                assert abs(value) < 2**20, f"{kind.__name__}.{name}"
            elif isinstance(value, np.void):
                addresses(value, get_type_hints(kind)[name])

    for record, kind in simulation._records().values():
        addresses(record, kind)
