"""The teleoperation task: both sides and the channels, glued to the loop of the simulation."""

from itertools import pairwise

import numpy as np
import pytest
from pydantic import ValidationError

from surgsim.errors import Outcome, SurgsimError
from surgsim.metrics.catalog import compute_metrics
from surgsim.models.peg_board import PegBoardLayout, transfer_goals
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import simulate
from surgsim.tasks.base import Feedback
from surgsim.tasks.teleoperation import TeleoperationConfig
from surgsim.tasks.teleoperation_program import GoalConfig, board_goals, way_points
from surgsim.teleop.bilateral.passive_convex import PassiveConvexConfig
from surgsim.teleop.channel import ChannelConfig
from surgsim.teleop.hand import HandCommand
from surgsim.teleop.tip_work import TipWork, add_tip_work
from surgsim.tick.arrays import new

START = np.array([0.0, 0.65, -0.03])
ONE_GOAL = (GoalConfig(position_m=(0.02, 0.65, -0.03)),)


def _feedback(p=START, f_T=(0.0, 0.0, 0.0)):
    zero = np.zeros(3)
    return Feedback(p_WT=np.array(p), v_WT=zero, R_WT=np.eye(3), w_WT=zero, f_T=np.array(f_T))


def _follow(task, count, f_T=(0.0, 0.0, 0.0)):
    """Commands and columns of a tip that follows its command exactly."""
    task.reset()
    p, commands, rows = START.copy(), [], []
    for k in range(count):
        command = task.command(1e-3 * k, _feedback(p, f_T))
        p = p + 1e-3 * command.v_WTd
        commands.append(command)
        rows.append(task.values())
    names = [name for block in task.columns for name in block.columns]
    return commands, dict(zip(names, np.array(rows).T, strict=True))


def test_the_command_is_what_the_master_stood_for_one_delay_ago():
    config = TeleoperationConfig(goals=ONE_GOAL, bilateral=PassiveConvexConfig(drift_gain_per_s=0.0))
    commands, run = _follow(config.build(START), 1500)
    delay = 150
    for axis, name in enumerate("xyz"):
        commanded = np.array([command.v_WTd[axis] for command in commands])
        issued = run[f"velocity_issued_{name}_m_per_s"]
        np.testing.assert_array_equal(commanded[delay:], issued[:-delay])
        assert not commanded[:delay].any()
    assert np.ptp([command.p_WTd[0] for command in commands]) > 0.005
    np.testing.assert_allclose(run["setpoint_age_s"][delay:], 0.15, atol=1e-9)


def test_another_seed_is_another_hand_and_the_same_seed_the_same():
    def handle(seed):
        task = TeleoperationConfig(goals=ONE_GOAL).build(START, 0.001, np.random.SeedSequence(seed))
        first = _follow(task, 400)[1]["handle_x_m"]
        np.testing.assert_array_equal(_follow(task, 400)[1]["handle_x_m"], first)
        return first

    assert not np.array_equal(handle(1), handle(2))


@pytest.mark.parametrize(("passivity", "limited"), [("tank", True), ("tdpa", False), ("off", False)])
def test_the_budget_is_the_remote_tank_s_with_the_force_as_measured(passivity, limited):
    task = TeleoperationConfig(bilateral=PassiveConvexConfig(passivity=passivity), goals=ONE_GOAL).build(
        START
    )
    command = _follow(task, 300, f_T=(-3.0, 0.0, 0.0))[0][-1]
    if not limited:
        assert command.budget is None
        return
    assert command.budget is not None
    names = [name for block in task.columns for name in block.columns]
    level = dict(zip(names, task.values(), strict=True))["tank_remote_j"]
    assert command.budget.most_j == pytest.approx(level - 0.01)
    np.testing.assert_array_equal(command.budget.f_T, [-3.0, 0.0, 0.0])


def test_the_remote_tank_pays_what_the_tip_gives_to_its_surroundings():
    commands, run = _follow(TeleoperationConfig(goals=ONE_GOAL).build(START), 1200, f_T=(-3.0, 0.0, 0.0))
    moved = 1e-3 * sum(command.v_WTd[0] for command in commands[:-1])
    assert moved > 0.005
    assert run["environment_work_j"][-1] == pytest.approx(3.0 * moved, rel=1e-9)
    assert run["tank_account_residual_j"] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("steps", [1, 2, 10])
@pytest.mark.parametrize("stiffness", [1e3, 2e4])
def test_work_against_a_spring_comes_back_whole(stiffness, steps):
    """Forces lag positions by a physics step, as a plant's do; the naive pairing is off by k T v^2 t."""
    x = 1e-3 * (1.0 - np.cos(np.linspace(0.0, 4.0 * np.pi, 399 * steps + 1)))
    work, total, naive, most = new(TipWork, 0), 0.0, 0.0, 0.0
    for k in range(steps, len(x), steps):
        force = np.array([-stiffness * x[k - 1], 0.0, 0.0])  # acted from k - 1 to k
        total += add_tip_work(work, np.array([x[k], 0.0, 0.0]), force, 1.0 / steps)
        naive -= float(force[0]) * (x[k] - x[k - steps])
        most = max(most, total)
    stored = 0.5 * stiffness * x.max() ** 2
    assert abs(total) < 1e-3 * stored
    assert most == pytest.approx(stored, rel=2e-2 if steps == 1 else 5e-3)
    if steps != 2:
        assert abs(naive) > 10.0 * abs(total)


def test_it_ends_a_while_after_the_last_goal_and_not_without_goals():
    goal = (GoalConfig(position_m=tuple(START), dwell_s=0.0),)
    task = TeleoperationConfig(goals=goal, hold_end_s=0.3).build(START)
    done = _follow(task, 1500)[1]["operator_done"]
    first = 1e-3 * int(np.argmax(done))
    assert done[-1] == 1.0
    assert not task.finished(first + 0.29)
    assert task.finished(first + 0.31)
    holding = TeleoperationConfig().build(START)
    _follow(holding, 50)
    assert not holding.finished(59.0)


def test_somebody_else_can_hold_the_handle():
    class Pusher:
        def step(self, t_s, seen_tip, handle):
            force = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
            return HandCommand(wrench=force, jaw=0.7, goal=0, done=False, missed=0)

    task = TeleoperationConfig().build(START)
    task.hold(Pusher())
    commands, run = _follow(task, 400)
    assert commands[-1].jaw == 0.7
    assert run["handle_x_m"][-1] > run["handle_x_m"][0]
    assert commands[-1].v_WTd[0] > 0.0


def test_a_dead_channel_stops_the_tip():
    config = TeleoperationConfig(
        goals=ONE_GOAL, channel=ChannelConfig(loss=0.9, burst_packets=2000.0, delay_s=0.01)
    )
    commands, run = _follow(config.build(START, 0.001, np.random.SeedSequence(1)), 3000)
    silent = run["setpoint_trust"] == 0.0
    assert silent.any()
    assert all(not command.v_WTd.any() for command, dead in zip(commands, silent, strict=True) if dead)


def test_the_board_s_program_is_that_of_its_layout_one_millimetre_higher():
    layout = PegBoardLayout(normal=(0.0, 1.0, 1.0), direction=(1.0, 0.0, 0.0))
    goals, steps = board_goals(layout, 5.0), transfer_goals(layout)
    assert [goal.jaw for goal in goals] == [step.jaw for step in steps]
    up = np.array([goal.position for goal in goals]) - [step.position for step in steps]
    np.testing.assert_allclose(
        up, np.tile([0.0, 0.001 / 2**0.5, 0.001 / 2**0.5], (len(goals), 1)), atol=1e-15
    )


def test_pushes_are_not_places_to_be_reached():
    goals = (*ONE_GOAL, GoalConfig(position_m=(0.5, 0.65, -0.03), push=True))
    points = way_points(START, tuple(goal.goal() for goal in goals))
    np.testing.assert_allclose(points[-1][1], ONE_GOAL[0].position_m)
    assert max(np.linalg.norm(b[1] - a[1]) for a, b in pairwise(points)) <= 0.005 + 1e-12


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("props=[]", "needs one peg_board in props, not 0"),
        ("task.board.peg_height_m=0.012", "not the peg_board in props: peg_height_m differ"),
        ("task.goals=[{position_m: [0, 0.65, -0.03]}]", "leave goals out"),
        ("task.console.timestep_s=0.0007", "must be a multiple of timestep_s"),
    ],
)
def test_what_does_not_fit_is_refused(change, message):
    with pytest.raises(SurgsimError, match=message):
        load_scenario("peg_and_ring_panda", assignments=[change])


def test_goals_keep_their_bounds():
    with pytest.raises(ValidationError, match="less than or equal to 1"):
        GoalConfig(position_m=(0.0, 0.0, 0.0), jaw=1.5)


def test_the_whole_loop_with_the_arm_moves_the_tip_through_the_port():
    scenario = load_scenario("teleop_free_motion_panda", assignments=["task.duration_s=1.5"])
    trace = simulate(scenario)
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    assert np.ptp(trace.block("tip")[:, 0]) > 0.005
    assert trace["rcm_error_m"].max() < 1e-4
    assert trace["tip_error_m"].max() < 5e-4
    assert np.abs(trace["tank_account_residual_j"]).max() < 1e-10


def test_equal_runs_are_equal():
    scenario = load_scenario("teleop_wall_panda", assignments=["task.duration_s=0.4", "seed=5"])
    first, again = (simulate(scenario) for _ in range(2))
    for name in ("tip_x_m", "handle_x_m", "lost_packets", "tank_operator_j"):
        np.testing.assert_array_equal(first[name], again[name])


def test_an_emptied_tank_holds_the_tip_back_in_tissue_and_the_ledger_still_closes():
    short = ["theatre=false", "task.duration_s=4.0"]
    trace = simulate(load_scenario("teleop_tissue_panda", controller="passive_convex", assignments=short))
    metrics = compute_metrics(trace)
    assert metrics["passivity_active_fraction"] > 0.01
    assert metrics["slack_rms_mm_per_s"] > 1.0
    assert metrics["tank_min_j"] > 0.0
    assert metrics["rcm_error_max_mm"] <= 0.1
    assert metrics["energy_residual_fraction"] <= 0.01
    assert metrics["infeasible_ticks"] == 0
