"""Rings are carried, dropped and counted, by an arm at torque level through its port."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from surgsim.errors import Outcome
from surgsim.metrics.catalog import compute_metrics
from surgsim.models.peg_board import transfer_goals
from surgsim.plant.props.ring_state import RingState
from surgsim.scenario.schema import Scenario
from surgsim.simulate.setup import prepare

ONE = {"source_m": ((-0.02, -0.022),), "target_m": ((-0.02, 0.022),)}
WEIGHT_N = 0.003 * 9.81


def moved(goals, names, offset):
    """The goals, those with such a step's name moved by `offset`."""
    return [
        replace(goal, position=goal.position + offset) if goal.name.split()[1] in names else goal
        for goal in goals
    ]


def states(trace):
    """The distinct states of the first ring, in order."""
    ring = trace.block("ring_state")[:, 0]
    changes = np.flatnonzero(np.diff(ring)) + 1
    return [RingState(int(ring[i])) for i in [0, *changes]]


@pytest.fixture(scope="module")
def carried(board_scenario, transfer):
    """The trace of one ring's transfer."""
    return transfer(board_scenario(**ONE)).run()


def test_a_ring_is_lifted_off_its_peg_carried_and_put_on_another(carried):
    assert carried.meta.ending.outcome is Outcome.COMPLETED
    assert states(carried) == [
        RingState.ON_SOURCE,
        RingState.GRASPED,
        RingState.ELSEWHERE,
        RingState.ON_TARGET,
    ]
    path = carried.block("ring1")
    assert path[:, 2].max() > -0.06 + 0.010  # over the pegs
    assert path[-1, 2] == pytest.approx(-0.06 + 0.00125, abs=1e-5)
    assert carried["rcm_error_m"].max() < 1e-5


def test_the_held_ring_is_felt_by_its_weight(carried):
    held = carried.block("ring_state")[:, 0] == RingState.GRASPED
    in_the_air = held & (carried.block("ring1")[:, 2] > -0.05)
    assert np.median(carried["grip_force_n"][in_the_air]) == pytest.approx(WEIGHT_N, rel=0.01)
    assert np.median(carried["jaws_load_n"][in_the_air]) == pytest.approx(WEIGHT_N, rel=0.01)
    assert carried["grip_force_n"][~held].max() == 0.0


def test_metrics_of_a_transfer(carried):
    metrics = compute_metrics(carried)
    assert metrics["rings_transferred"] == 1.0
    assert metrics["rings_transferred_fraction"] == 1.0
    assert metrics["ring_drops"] == 0.0
    ring = carried.block("ring_state")[:, 0]
    grasp, rest = np.flatnonzero(ring == 1.0)[0], np.flatnonzero(ring == 2.0)[0]
    assert metrics["transfer_time_s"] == pytest.approx(1e-3 * (rest - grasp))
    assert metrics["peg_contact_force_max_n"] == carried["jaws_load_n"].max() > WEIGHT_N


def test_two_runs_are_equal_bit_for_bit_and_so_is_one_after_a_reset_in_the_middle(
    board_scenario, transfer, carried
):
    scenario = board_scenario(**ONE)
    simulation = transfer(scenario)
    while simulation.time_s < 2.5:
        simulation.tick()
    assert simulation.trace().block("ring_state")[-1, 0] == RingState.GRASPED
    again = type(simulation)(simulation._setup)
    assert again.run().equals(carried)


def test_all_rings_of_the_default_board_are_transferred_from_yaml(board_scenario, transfer):
    scenario = board_scenario()
    read = Scenario.model_validate_json(scenario.model_dump_json())
    assert read == scenario
    trace = transfer(read).run()
    assert trace.block("ring_state")[-1].tolist() == [RingState.ON_TARGET] * 3
    assert trace["rings_on_target"][-1] == 3.0
    assert trace["ring_drop_count"][-1] == 0.0


@pytest.mark.parametrize("offset", [(0.0015, 0.0, 0.0), (0.0, -0.0015, 0.0)])
def test_a_ring_put_1_5_mm_beside_its_place_still_goes_over_the_peg(board_scenario, transfer, offset):
    scenario = board_scenario(**ONE)
    goals = moved(
        transfer_goals(scenario.props[0]), ("hover_target", "place", "release", "leave"), np.array(offset)
    )
    trace = transfer(scenario, goals).run()
    assert trace["rings_on_target"][-1] == 1.0
    assert trace["ring_drop_count"][-1] == 0.0


def test_jaws_that_close_out_of_reach_of_a_rim_catch_nothing(board_scenario, transfer):
    scenario = board_scenario(**ONE)
    goals = moved(transfer_goals(scenario.props[0])[:4], ("approach", "grasp"), np.array([0.0, 0.0, 0.003]))
    trace = transfer(scenario, goals).run()
    assert states(trace) == [RingState.ON_SOURCE]
    assert compute_metrics(trace)["transfer_time_s"] is None


def test_a_grip_weaker_than_the_rings_weight_drops_it(board_scenario, transfer):
    scenario = board_scenario(grip_force_n=0.7 * WEIGHT_N, **ONE)
    trace = transfer(scenario, transfer_goals(scenario.props[0])[:5]).run()
    assert trace["rings_on_target"][-1] == 0.0
    assert trace["ring_drop_count"][-1] == 1.0
    assert compute_metrics(trace)["rings_transferred_fraction"] == 0.0


@pytest.mark.parametrize(("jaw", "how"), [(0.4, "slips"), (0.0, "let go")])
def test_a_ring_lost_on_the_way_is_one_drop_and_lies_elsewhere(board_scenario, transfer, jaw, how):
    scenario = board_scenario(grip_force_n=2 * WEIGHT_N, **ONE)
    goals = transfer_goals(scenario.props[0])[:4]
    between = goals[3].position + np.array([0.0, 0.022, 0.0])
    goals += [replace(goals[3], position=between, jaw=jaw, dwell_s=0.5)]
    trace = transfer(scenario, goals).run()
    assert states(trace)[-1] is RingState.ELSEWHERE
    assert trace["ring_drop_count"][-1] == 1.0
    assert trace.block("ring1")[-1, 2] == pytest.approx(-0.06 + 0.00125, abs=1e-4)
    assert np.abs(np.diff(trace.block("ring1")[-50:], axis=0)).max() < 1e-6


@pytest.mark.parametrize("timestep", [0.001, 0.0005])
def test_rings_at_rest_neither_sink_nor_tremble(board_scenario, timestep):
    setup = prepare(board_scenario(assignments=(f"simulation.timestep_s={timestep}",)))
    model, data = setup.scene.model, setup.plant._data
    setup.plant.reset(setup.q_start)
    names = ("ring1", "ring2", "ring3")
    start = np.array([data.body(name).xpos for name in names])
    dofs = np.concatenate([model.joint(name).dofadr[0] + np.arange(6) for name in names])
    fastest = 0.0
    for tick in range(2000):
        setup.plant.step(data.qfrc_bias[:7].copy(), np.zeros(7))
        fastest = max(fastest, np.abs(data.qvel[dofs]).max()) if tick > 500 else 0.0
    moved_m = np.array([data.body(name).xpos for name in names]) - start
    assert np.abs(moved_m).max() < 1e-6
    assert fastest < 1e-4


def test_an_opened_and_closed_hold_adds_no_energy(board_scenario):
    """A ring hangs from jaws held still: caught where it is, it only gives energy away."""
    setup = prepare(board_scenario(**ONE))
    model, data = setup.scene.model, setup.plant._data
    setup.plant.reset(setup.q_start)
    first = model.joint("ring1").qposadr[0]
    dof = model.joint("ring1").dofadr[0]
    tip = data.body("jaws").xpos.copy()
    data.qpos[first : first + 3] = tip + np.array([-0.00575, 0.0, -0.0018])
    data.qvel[dof : dof + 3] = [0.0, 0.0, 0.05]
    mujoco.mj_step1(model, data)
    mass = 0.003
    spin = model.body("ring1").inertia

    def energy():
        v, w = data.qvel[dof : dof + 3], data.qvel[dof + 3 : dof + 6]
        height = data.qpos[first + 2]
        return 0.5 * mass * v @ v + 0.5 * spin @ w**2 + mass * 9.81 * height

    lock = setup.scene.dof_ids
    before, highest = energy(), -np.inf
    for tick in range(400):
        setup.plant.step(data.qfrc_bias[:7].copy(), np.zeros(7), jaw=1.0)
        data.qvel[lock] = 0.0
        if tick > 1:
            highest = max(highest, energy())
    assert data.eq_active.sum() == 1
    assert highest <= before + 1e-9


def test_a_ring_on_another_rests_on_its_rim(board_scenario):
    setup = prepare(board_scenario())
    model, data = setup.scene.model, setup.plant._data
    setup.plant.reset(setup.q_start)
    first, second = (model.joint(name).qposadr[0] for name in ("ring1", "ring2"))
    data.qpos[second : second + 3] = data.qpos[first : first + 3] + np.array([0.0, 0.0, 0.003])
    for _ in range(500):
        setup.plant.step(data.qfrc_bias[:7].copy(), np.zeros(7))
    heights = data.qpos[[first + 2, second + 2]] + 0.06
    np.testing.assert_allclose(heights, [0.00125, 0.00375], atol=1e-5)


def test_jaws_that_press_on_a_ring_feel_it_and_the_ring_stays_on_the_board(board_scenario, transfer):
    scenario = board_scenario(**ONE)
    goals = moved(transfer_goals(scenario.props[0])[:2], ("approach",), np.array([0.0, 0.0, -0.0007]))
    trace = transfer(scenario, goals).run()
    assert 0.5 < trace["jaws_load_n"].max() < 10.0
    assert trace.block("ring1")[:, 2].min() > -0.06 + 0.00125 - 2e-4
    felt = np.linalg.norm(trace.block("tip_force"), axis=1)
    np.testing.assert_allclose(felt, trace["jaws_load_n"], atol=1e-9)


def test_a_snapshot_with_a_ring_in_the_jaws_goes_on_with_the_same_bits(board_scenario, transfer):
    scenario = board_scenario(**ONE)
    simulation, other = transfer(scenario), transfer(scenario)

    def held():
        return simulation.trace().block("ring_state")[-1, 0] == RingState.GRASPED

    simulation.advance(50)
    while not held():
        simulation.advance(50)
    taken = simulation.snapshot()
    simulation.advance(400)
    assert held()
    other.restore(taken)
    other.advance(400)
    here, there = simulation.trace(), other.trace()
    kept = [k for k, name in enumerate(here.columns) if name != "control_time_s"]
    np.testing.assert_array_equal(here.data[:, kept], there.data[:, kept])
