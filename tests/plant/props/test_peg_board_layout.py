"""The board's geometry and the tip's goals: consistent, free of MuJoCo, and within reach of both arms."""

import numpy as np
import pytest
from pydantic import ValidationError

from surgsim.models.peg_board import PegBoardLayout, grasp_side, transfer_goals
from surgsim.scenario.load import load_scenario
from surgsim.simulate.reach import Reach
from surgsim.simulate.setup import prepare
from surgsim.simulate.start import check_through_port

STEPS = ["hover_source", "approach", "grasp", "lift", "hover_target", "place", "release", "leave"]


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"target_m": ((0.0, 0.02),)}, "3 source pegs and 1 target pegs"),
        ({"hole_radius_m": 0.002}, "hole_radius_m 0.002 must be above peg_radius_m 0.00225"),
        ({"peg_height_m": 0.0024}, "peg_height_m 0.0024 must stand out"),
        ({"rim_radius_m": 0.003}, "rings 0.021 m wide would overlap"),
        ({"normal": (1.0, 0.0, 0.0)}, "parallel"),
    ],
)
def test_impossible_boards_are_refused(keys, message):
    with pytest.raises(ValidationError, match=message):
        PegBoardLayout(**keys)


def test_every_ring_goes_through_the_same_steps_with_closed_jaws_between_grasp_and_place():
    goals = transfer_goals(PegBoardLayout())
    names = [f"ring{ring} {step}" for ring in (1, 2, 3) for step in STEPS]
    assert [goal.name for goal in goals] == names
    closed = [goal.name.split()[1] for goal in goals if goal.jaw == 1.0]
    assert closed == ["grasp", "lift", "hover_target", "place"] * 3


def test_a_ring_is_grasped_at_its_rim_across_its_way_on_the_inner_side():
    layout = PegBoardLayout()
    for ring, x in enumerate((1.0, 1.0, -1.0)):
        np.testing.assert_allclose(grasp_side(layout, ring), [x, 0.0], atol=1e-15)
        goals = [goal for goal in transfer_goals(layout) if goal.ring == ring]
        grasp, place = goals[2].position, goals[5].position
        offset = grasp - layout.point(*layout.source_m[ring], 0.0)
        assert np.hypot(*offset[:2]) == pytest.approx(layout.hole_radius_m + layout.rim_radius_m)
        np.testing.assert_allclose((place - grasp)[:2], (0.0, 0.044), atol=1e-15)


def test_the_goals_move_and_turn_with_the_board():
    here, there = PegBoardLayout(), PegBoardLayout(position_m=(0.1, 0.2, 0.3), direction=(0.0, 1.0, 0.0))
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    for a, b in zip(transfer_goals(here), transfer_goals(there), strict=True):
        moved = turn @ (a.position - here.position_m) + there.position_m
        np.testing.assert_allclose(b.position, moved, atol=1e-15)


@pytest.mark.parametrize(
    ("scenario", "board"), [("circle_panda", (0.0, 0.65, -0.06)), ("circle_lwr4plus", (0.0, 0.55, -0.01))]
)
def test_the_shaft_reaches_every_goal_through_the_port(scenario, board):
    scenario = load_scenario(scenario)
    setup = prepare(scenario)
    reach = Reach(setup.arm, scenario.scene)
    q = setup.q_start
    for goal in transfer_goals(PegBoardLayout(position_m=board)):
        check_through_port(goal.position, goal.name, scenario.instrument, scenario.trocar)
        for share in np.linspace(0.25, 1.0, 4):
            here = setup.arm.kinematics(q).p_WT
            q = reach.settle(here + share * (goal.position - here), q)
        assert max(reach.miss(q, goal.position)) < 1e-6, goal.name
        room = np.minimum(q - setup.arm.limits.q_min, setup.arm.limits.q_max - q)
        assert room.min() > 0.3, goal.name
