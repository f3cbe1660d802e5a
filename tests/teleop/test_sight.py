"""The operator looks at the rings: late, with an error, and goes back for one that did not come along."""

import numpy as np
import pytest
from pydantic import ValidationError

from surgsim.errors import Outcome
from surgsim.metrics.catalog import compute_metrics
from surgsim.models.peg_board import TRANSFER_STEPS, PegBoardLayout, transfer_goals
from surgsim.scenario.hashed import hashed
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import prepare
from surgsim.tasks.teleoperation import TeleoperationConfig
from surgsim.teleop.operator import OperatorConfig
from surgsim.teleop.sight import (
    RING_ROW,
    SHOWN,
    Sight,
    SightConfig,
    SightLaw,
    board_rows,
    describe_sight,
    goal_after,
    has_come_up,
    is_placed,
    picture_size,
    see_picture,
    show_first,
    take_aim,
    take_picture,
)
from surgsim.tick.arrays import new, point
from surgsim.tick.blank import new_feedback
from surgsim.verdict import judge

LAYOUT = PegBoardLayout()
STEPS = {name: i for i, name in enumerate(TRANSFER_STEPS)}
ONE = "{source_m: [[-0.02, -0.022]], target_m: [[-0.02, 0.022]]}"
BOARD = (
    f"task.board={ONE}",
    "props=[{type: peg_board, source_m: [[-0.02, -0.022]], target_m: [[-0.02, 0.022]]}]",
)


class Eyes:
    """Sight of a board with three rings; pictures are kept for five ticks."""

    def __init__(self, config=None, layout=LAYOUT, seed=0):
        self.law, self.sight, self.layout = new(SightLaw, 0), new(Sight, 0), layout
        describe_sight(self.law, config or SightConfig(use=True), layout)
        self.gains, size = board_rows(layout).ravel(), picture_size(len(layout.source_m))
        self.law.board, self.law.kept, self.law.pictures = 0, 5, 0
        self.law.seen, self.law.aims = 5 * size, 6 * size
        draws = np.random.default_rng(seed).standard_normal(3 * 4000)
        self.memory = np.concatenate([np.zeros(6 * size), draws])
        show_first(self.law, self.gains, self.sight, self.memory, np.zeros(3))

    def show(self, tip, rings):
        at = self.law.seen
        self.memory[at : at + 3 + 3 * len(rings)] = np.concatenate([tip, np.ravel(rings)])

    def after(self, step, ring=0):
        index = len(STEPS) * ring + STEPS[step]
        return goal_after(self.law, self.gains, self.sight, self.memory, index)

    def aim(self, step, ring=0):
        take_aim(self.law, self.gains, self.sight, self.memory, len(STEPS) * ring + STEPS[step])
        return self.sight.shift.copy()


def places(layout=LAYOUT):
    """Middles of the rings on their sources and on their targets (3, 3) each."""
    return tuple(
        np.array([layout.point(*place, layout.rim_radius_m) for place in pegs])
        for pegs in (layout.source_m, layout.target_m)
    )


def test_a_picture_is_seen_when_its_packet_has_come_and_not_before():
    eyes, told = Eyes(), new_feedback()
    rows = np.arange(40.0)
    point(told.plant, rows)
    for ring in range(3):
        eyes.gains[RING_ROW * ring + SHOWN] = 4 + 7 * ring
    for number in range(9):
        rows[4] = 100.0 + number
        told.p_WT[0] = number
        take_picture(eyes.law, eyes.gains, told, eyes.memory, number)
        see_picture(eyes.law, eyes.sight, eyes.memory, number - 4 if number >= 4 else -1)
        seen = eyes.memory[eyes.law.seen : eyes.law.seen + 12]
        if number < 4:
            np.testing.assert_array_equal(seen[3:], places()[0].ravel())
        else:
            assert seen[0] == number - 4
            np.testing.assert_array_equal(seen[3:6], [96.0 + number, 5.0, 6.0])
            np.testing.assert_array_equal(seen[9:12], [18.0, 19.0, 20.0])


def test_the_error_is_of_the_stated_size_across_and_along_the_line_of_sight():
    line = np.array([0.3, 0.5, -1.0]) / np.linalg.norm([0.3, 0.5, -1.0])
    eyes = Eyes(SightConfig(use=True, across_m=0.001, depth_m=0.003, line_of_sight=tuple(line)))
    errors = []
    for _ in range(4000):
        eyes.aim("hover_source")
        errors.append(eyes.sight.error.copy())
    along = np.array(errors) @ line
    across = np.array(errors) - along[:, None] * line
    assert along.std() == pytest.approx(0.003, rel=0.05)
    assert np.sqrt(np.mean(np.sum(across**2, axis=1)) / 2) == pytest.approx(0.001, rel=0.05)


def test_it_aims_where_the_ring_lies_and_puts_down_its_middle():
    eyes = Eyes(SightConfig(use=True, across_m=0.0, depth_m=0.0))
    source, target = places()
    moved = source + np.array([0.004, -0.003, 0.0])
    eyes.show(np.zeros(3), moved)
    goals = transfer_goals(LAYOUT)
    np.testing.assert_allclose(eyes.aim("hover_source", 1), moved[1] - source[1], atol=1e-15)
    np.testing.assert_allclose(eyes.aim("grasp", 1), moved[1] - source[1], atol=1e-15)
    held = np.array([0.01, 0.0, 0.0])  # the ring's middle from the tip, askew in the jaws and lower
    tip = np.array([0.0, 0.6, -0.04])
    eyes.show(tip, np.tile(tip + held - [0.0, 0.0, 0.003], (3, 1)))
    over = goals[len(STEPS) + STEPS["hover_target"]].position + eyes.aim("hover_target", 1)
    np.testing.assert_allclose((over + held)[:2], target[1, :2], atol=1e-12)
    assert over[2] == pytest.approx(goals[STEPS["hover_target"]].position[2])


@pytest.mark.parametrize("step", ["lift", "hover_target"])
def test_a_ring_that_did_not_come_up_is_sought_again(step):
    eyes = Eyes()
    source, _ = places()
    tip = transfer_goals(LAYOUT)[STEPS["lift"]].position
    eyes.show(tip, source)
    assert not has_come_up(eyes.law, eyes.memory, 0)
    assert eyes.after(step) == STEPS["hover_source"]
    assert (eyes.sight.regrasps, eyes.sight.given_up) == (1, 0)
    eyes.show(tip, [tip - [0.005, 0.0, 0.002], *source[1:]])
    assert has_come_up(eyes.law, eyes.memory, 0)
    assert eyes.after(step) == STEPS[step] + 1
    assert eyes.sight.regrasps == 1


def test_a_ring_beside_its_target_is_sought_again_and_one_off_the_board_given_up():
    eyes = Eyes()
    source, target = places()
    tip = transfer_goals(LAYOUT)[STEPS["leave"]].position
    for offset, placed in (([0.003, 0.0, 0.0], True), ([0.005, 0.0, 0.0], False), ([0.0, 0.0, 0.006], False)):
        eyes.show(tip, [target[0] + offset, *source[1:]])
        assert is_placed(eyes.law, eyes.gains, eyes.memory, 0) is placed
        assert eyes.after("leave") == (len(STEPS) if placed else STEPS["hover_source"])
    eyes.show(tip, [target[0] + [0.05, 0.0, -0.005], *source[1:]])
    assert eyes.after("leave") == len(STEPS)
    assert eyes.sight.given_up == 1


def looked(*assignments):
    """The trace of a transfer of one ring by an operator that looks, without delay."""
    scenario = load_scenario(
        "peg_and_ring_panda",
        assignments=("theatre=false", "task.operator.sight.use=true", *BOARD, *assignments),
    )
    return Simulation(prepare(scenario)).run()


def test_a_missed_ring_is_grasped_again_and_the_same_seed_gives_the_same_run():
    settings = ("task.channel.delay_s=0.0", "task.operator.sight.depth_m=0.004", "seed=0")
    trace = looked(*settings)
    assert trace["regrasps"][-1] >= 1.0
    assert trace["rings_on_target"][-1] == 1.0
    assert trace["operator_done"][-1] == 1.0
    goal = trace["goal"]
    back = np.flatnonzero(np.diff(goal) < 0.0)
    assert len(back) == trace["regrasps"][-1]
    assert (trace["jaw_command"][back] == 1.0).any()
    assert (np.diff(np.flatnonzero(np.diff(trace["aim_error_x_m"]) != 0.0)) > 100).all()
    assert looked(*settings).equals(trace)


def test_a_time_limit_ends_the_run_as_not_done():
    trace = looked("task.channel.delay_s=0.0", "task.time_limit_s=1.5")
    assert trace.meta.ending.outcome is Outcome.TIME_LIMIT
    assert trace.meta.ending.t_s == pytest.approx(1.5)
    verdict = judge(trace, compute_metrics(trace))
    assert verdict.success is False
    assert verdict.reason == "the run ended as time_limit"


def test_a_run_that_is_done_in_time_completes_though_the_limit_passes_while_it_holds_still():
    keys = {"program": "goals", "start_m": (0.0, 0.65, -0.03), "hold_end_s": 0.5}
    goal = {"position_m": (0.0, 0.65, -0.03), "tolerance_m": 0.01, "dwell_s": 0.2}
    task = TeleoperationConfig(goals=(goal,), time_limit_s=1.0, duration_s=10.0, **keys).build(
        np.array(keys["start_m"])
    )
    t, done = 0.0, []
    while not task._out.finished:
        task.command(t)
        done.append(task.values()[33])
        t += 0.001
    assert 0.5 < done.index(1.0) * 1e-3 < 1.0 < t
    assert task._out.finished == 1


def test_eyes_without_rings_are_refused():
    with pytest.raises(ValidationError, match="looks at the rings of the program 'peg_and_ring'"):
        TeleoperationConfig(operator=OperatorConfig(sight=SightConfig(use=True)))


def test_without_sight_nothing_of_it_is_in_trace_or_hash():
    task = TeleoperationConfig()
    assert "regrasps" not in {name for block in task.build(np.zeros(3)).columns for name in block.columns}
    told = hashed(load_scenario("peg_and_ring_panda"))["task"]
    assert "sight" not in told["operator"]
    assert "time_limit_s" not in told
    looks = load_scenario("peg_and_ring_panda", assignments=("task.operator.sight.use=true",))
    assert hashed(looks)["task"]["operator"]["sight"]["use"] is True
