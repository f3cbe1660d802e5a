"""Two hinged jaws hold a ring by friction alone, and shaft and jaws feel what they touch."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from pydantic import ValidationError

from surgsim.errors import Outcome, SurgsimError
from surgsim.models.peg_board import transfer_goals
from surgsim.plant.props.hinged_jaws import JAWS, OPEN_RAD, SHAFT
from surgsim.plant.props.peg_board import PegBoardConfig
from surgsim.plant.props.ring_state import RingState
from surgsim.scenario.load import load_scenario
from surgsim.simulate.setup import prepare

ONE = {"source_m": ((-0.02, -0.022),), "target_m": ((-0.02, 0.022),), "hold": "friction"}
WEIGHT_N = 0.003 * 9.81
SLIDES = 0.8  # mu of the fingers, in the file of the jaws


def a_little_higher(scenario):
    """The goals, as the teleoperating operator has them: the fingers do not press on the board."""
    up = np.array([0.0, 0.0, 0.001])
    return [replace(goal, position=goal.position + up) for goal in transfer_goals(scenario.props[0])]


@pytest.fixture(scope="module")
def carried(board_scenario, transfer):
    """The trace of one ring's transfer by friction."""
    scenario = board_scenario(**ONE)
    return transfer(scenario, a_little_higher(scenario)).run()


def held_in_the_air(trace):
    held = trace.block("ring_state")[:, 0] == RingState.GRASPED
    return held & (trace.block("ring1")[:, 2] > -0.052)


def test_a_ring_is_carried_by_friction_and_put_on_its_peg(carried):
    assert carried.meta.ending.outcome is Outcome.COMPLETED
    assert carried.block("ring_state")[-1, 0] == RingState.ON_TARGET
    assert carried["ring_drop_count"][-1] == 0.0
    assert held_in_the_air(carried).sum() > 1000
    assert carried["rcm_error_m"].max() < 1e-4


def test_the_held_ring_stays_in_the_jaws(carried):
    air = np.flatnonzero(held_in_the_air(carried))
    away = np.linalg.norm(carried.block("ring1") - carried.block("tip"), axis=1)[air]
    assert np.ptp(away[300:]) < 5e-4


def test_the_jaws_open_close_on_the_rim_and_open_again(carried):
    for name in JAWS:
        angle = carried[f"{name}_rad"]
        assert angle[0] == pytest.approx(OPEN_RAD)
        assert angle[-1] == pytest.approx(OPEN_RAD, abs=1e-3)
    air = held_in_the_air(carried)
    between = carried["jaw_left_rad"][air] + carried["jaw_right_rad"][air]
    assert np.abs(between).max() < 0.05  # a rim of 2.5 mm is what stands between them at zero


def test_squeezing_is_no_force_of_the_surroundings_and_as_strong_as_the_stated_grip(carried):
    air = held_in_the_air(carried)
    assert np.median(carried["jaws_load_n"][air]) == pytest.approx(WEIGHT_N, rel=0.05)
    assert np.median(carried["grip_force_n"][air]) == pytest.approx(3.0 / (2.0 * SLIDES), rel=0.15)
    felt = np.linalg.norm(carried.block("tip_force"), axis=1)
    np.testing.assert_allclose(felt, carried["jaws_load_n"], atol=1e-12)


def test_a_grip_weaker_than_the_rings_weight_does_not_lift_it(board_scenario, transfer):
    scenario = board_scenario(**{**ONE, "grip_force_n": 0.7 * WEIGHT_N})
    trace = transfer(scenario, a_little_higher(scenario)[:4]).run()
    assert trace.block("ring1")[-1, 2] < -0.055
    assert trace.block("ring_state")[-1, 0] != RingState.GRASPED


def test_nothing_but_contact_holds_and_the_arm_has_the_joints_that_it_had(board_scenario):
    setup, plain = prepare(board_scenario(**ONE)), prepare(board_scenario())
    model = setup.scene.model
    assert model.neq == plain.scene.model.neq - 3
    assert model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
    assert plain.scene.model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL
    np.testing.assert_array_equal(setup.scene.dof_ids, plain.scene.dof_ids)
    assert [int(model.joint(name).type[0]) for name in JAWS] == [int(mujoco.mjtJoint.mjJNT_HINGE)] * 2


def test_the_shaft_touches_and_its_force_is_told(board_scenario):
    setup = prepare(board_scenario(**ONE))
    model, data = setup.scene.model, setup.plant._data
    setup.plant.reset(setup.q_start)
    column = [name for block in setup.plant.columns for name in block.columns].index("shaft_load_n")
    assert setup.plant.truth().values[column] == 0.0
    shaft, ring = model.geom(SHAFT).id, model.joint("ring1").qposadr[0]
    rim = np.array([0.00575 + 0.00125 + 0.0038, 0.0, 0.0])
    data.qpos[ring : ring + 3] = data.geom_xpos[shaft] + rim
    for _ in range(2):  # the first step has the contacts of before
        setup.plant.step(data.qfrc_bias[:7].copy(), np.zeros(7))
    assert setup.plant.truth().values[column] > 0.01


def test_what_cannot_be_is_refused(board_scenario):
    with pytest.raises(ValidationError, match="jaws_turn_deg turns hinged jaws"):
        PegBoardConfig(jaws_turn_deg=90.0)
    scenario = load_scenario(
        "circle_panda",
        controller="rcm_inverse_dynamics",
        assignments=(
            "theatre=false",
            "instrument={name: hook_30}",
            "props=[{type: peg_board, hold: friction}]",
        ),
    )
    with pytest.raises(SurgsimError, match="is for the shipped straight instrument"):
        prepare(scenario)
