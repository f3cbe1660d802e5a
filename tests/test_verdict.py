"""The verdict: whether a task was done, from the trace alone, and the thresholds with their source."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from surgsim.columns import Block, scalar
from surgsim.errors import Outcome
from surgsim.metrics.catalog import METRICS, compute_metrics
from surgsim.scenario.load import load_scenario
from surgsim.scenario.thresholds import ThresholdsConfig
from surgsim.simulate.loop import simulate
from surgsim.tasks import TASKS
from surgsim.trace.trace import Ending, Trace, TraceMeta, base_blocks
from surgsim.verdict import Held, judge, unfinished

DONE = Ending(outcome=Outcome.COMPLETED, t_s=1.0)
GOALS = "[{position_m: [0, 0.65, -0.03]}, {position_m: [0.01, 0.65, -0.03]}]"
STILL = "the operator was still at goal 2 of 2 when time was up"
TELEOPERATED = (scalar("goal"), scalar("goals_missed"), scalar("operator_done"))


def run(name, columns, *, extra=(), ending=DONE, settings=()):
    """A made-up trace of two rows of the shipped scenario `name`, its last row with these values."""
    blocks = (*base_blocks(7), *extra)
    names = [column for block in blocks for column in block.columns]
    data = np.zeros((2, len(names)))
    for column, value in columns.items():
        data[-1, names.index(column)] = value
    scenario = load_scenario(name, assignments=settings).resolved()
    limits = dict.fromkeys(("q_max", "velocity", "acceleration", "torque"), [1.0] * 7)
    limits["q_min"] = [-1.0] * 7
    meta = TraceMeta(scenario=scenario, control_period_s=0.001, limits=limits, ending=ending)
    return Trace(data, blocks, meta)


def verdict(trace, **metrics):
    """The verdict, with the metrics that thresholds are about."""
    own = {"tip_error_end_mm": 0.1, "tip_error_max_mm": 0.2, "rcm_error_max_mm": 0.3}
    return judge(trace, {**dict.fromkeys(METRICS), **own, **metrics})


def test_a_path_that_was_followed_is_done_and_the_line_says_within_what():
    found = verdict(run("circle_lwr4plus", {}))
    assert (found.success, found.reason, found.exceeded) == (True, "the path was followed", ())
    assert found.line() == (
        "Done: the path was followed; within tip_error_end_mm 0.1 of 1, tip_error_max_mm 0.2 of 3, "
        "rcm_error_max_mm 0.3 of 5, docs/safety.md."
    )


@pytest.mark.parametrize(
    ("metrics", "reason"),
    [
        ({"tip_error_max_mm": 5.0}, "tip_error_max_mm 5 exceeds 3, docs/safety.md"),
        ({"tip_error_end_mm": 1.5}, "tip_error_end_mm 1.5 exceeds 1, docs/safety.md"),
        ({"tip_error_max_mm": 3.0000001}, "tip_error_max_mm 3.0000001 exceeds 3, docs/safety.md"),
    ],
)
def test_a_tip_that_left_its_path_has_not_done_its_task_though_it_completed(metrics, reason):
    found = verdict(run("circle_lwr4plus", {}), **metrics)
    assert (found.success, found.reason) == (False, reason)
    assert found.line() == f"NOT done: {reason}."


def test_a_shaft_that_left_the_trocar_did_its_task_and_the_line_says_at_what_price():
    found = verdict(run("circle_lwr4plus", {}), rcm_error_max_mm=12.61)
    assert found.success is True
    assert [held.metric for held in found.exceeded] == ["rcm_error_max_mm"]
    assert found.line() == (
        "Done, but rcm_error_max_mm 12.6 exceeds 5, docs/safety.md (the path was followed)."
    )


def test_a_threshold_of_the_scenarios_own_is_the_scenarios_and_null_leaves_it_out():
    settings = ["thresholds.rcm_error_max_mm.most=0.2", "thresholds.tip_error_max_mm=null"]
    found = verdict(run("circle_lwr4plus", {}, settings=settings), tip_error_max_mm=9.0)
    assert str(found.exceeded[0]) == "rcm_error_max_mm 0.3 exceeds 0.2, the scenario"
    assert [held.metric for held in found.thresholds] == ["tip_error_end_mm", "rcm_error_max_mm"]
    settings = ["thresholds.tip_error_end_mm=null", "thresholds.tip_error_max_mm=null"]
    found = verdict(run("circle_lwr4plus", {}, settings=settings))
    assert found.success is None
    assert found.reason == "no threshold is set for tip_error_end_mm or tip_error_max_mm"


@pytest.mark.parametrize("outcome", [each for each in Outcome if each is not Outcome.COMPLETED])
def test_a_run_that_was_stopped_is_not_done(outcome):
    ending = replace(DONE, outcome=outcome)
    found = verdict(run("circle_lwr4plus", {}, ending=ending), rcm_error_max_mm=51.0)
    name = outcome.name.lower()
    assert (found.success, found.reason) == (False, f"the run ended as {name}")
    assert (
        found.line() == f"NOT done: the run ended as {name}; rcm_error_max_mm 51 exceeds 5, docs/safety.md."
    )


@pytest.mark.parametrize(
    ("states", "done", "reason"),
    [
        ([2, 2, 2], True, "3 of 3 rings are on their pegs"),
        ([2, 1, 2], False, "2 of 3 rings are on their pegs"),
        ([0, 0, 3], False, "0 of 3 rings are on their pegs"),
    ],
)
def test_rings_beside_their_pegs_are_no_success(states, done, reason):
    block = Block("ring_state", ("1_", "2_", "3_"), "")
    columns = dict(zip(block.columns, states, strict=True))
    found = verdict(run("peg_and_ring_panda", columns, extra=(block,)), tip_error_max_mm=9.0)
    assert (found.success, found.reason) == (done, reason)
    assert "tip_error" not in found.line()


@pytest.mark.parametrize(
    ("at", "missed", "over", "done", "reason"),
    [
        (2, 0, 1, True, "2 of 2 goals were reached"),
        (2, 1, 1, False, "1 of 2 goals were reached"),
        (1, 0, 0, False, f"{STILL}: the tip is 651 mm from it"),
        (1, 1, 0, False, f"{STILL}, 1 missed: the tip is 651 mm from it"),
        (0, 0, 1, None, "a person operated, whose goals nobody counts"),
    ],
)
def test_goals_that_were_missed_are_no_success(at, missed, over, done, reason):
    columns = {"goal": at, "goals_missed": missed, "operator_done": over}
    made = run("teleop_wall_panda", columns, extra=TELEOPERATED, settings=[f"task.goals={GOALS}"])
    assert (verdict(made).success, verdict(made).reason) == (done, reason)


def test_without_goals_there_is_no_success_to_speak_of():
    found = verdict(run("teleop_wall_panda", {}, extra=TELEOPERATED, settings=["task.goals=[]"]))
    assert (found.success, found.reason) == (None, "the operator has no goals")
    assert found.line().startswith("Whether it was done is not defined: the operator has no goals; within ")


def test_an_insertion_is_done_at_depth():
    extra = (scalar("insertion_depth", "m"), scalar("insertion_phase"))
    short = {"insertion_depth_m": 0.03, "insertion_phase": 1.0}
    found = verdict(run("insertion_lwr4plus", short, extra=extra))
    assert found.success is False
    assert found.reason.startswith("the shaft came to 30.0 mm of ")
    inside = {"insertion_depth_m": 0.1, "insertion_phase": 2.0}
    found = verdict(run("insertion_lwr4plus", inside, extra=extra))
    assert (found.success, found.reason) == (True, "the instrument is inserted")
    assert verdict(run("insertion_lwr4plus", inside, extra=extra), tip_error_max_mm=4.0).success is False


def test_a_task_whose_judgement_fails_costs_no_run():
    found = verdict(run("peg_and_ring_panda", {}))  # without the columns of its board
    assert found.success is None
    assert found.reason.startswith("it could not be judged, ")
    assert "'ring_state'" in found.reason
    assert found.to_dict()["thresholds"] == []


def test_every_shipped_task_says_what_success_is():
    assert [name for name in TASKS.names() if not hasattr(TASKS.config(name), "success")] == []


def test_every_threshold_is_named_after_a_metric_and_has_a_source():
    for name, threshold in ThresholdsConfig():
        assert name in METRICS
        assert threshold.source == "docs/safety.md"


def test_a_figure_near_its_threshold_is_never_printed_as_equal_to_it():
    assert str(Held(metric="a", value=5.0004, most=5.0, source="b")) == "a 5.0004 exceeds 5, b"
    assert Held(metric="a", value=4.9999, most=5.0, source="b").figure == "5"
    assert Held(metric="a", value=math.nan, most=5.0, source="b").exceeded


def test_a_run_without_a_trace_is_not_done():
    assert unfinished("crashed").line() == "NOT done: the run ended as crashed."
    assert json.dumps(unfinished("crashed").to_dict())


def test_a_real_run_is_judged_the_same_from_its_stored_meta_data(scenario):
    trace = simulate(scenario())
    found = judge(trace, compute_metrics(trace))
    assert found.success is True
    again = Trace(trace.data, trace.blocks, TraceMeta.from_json(trace.meta.to_json()))
    assert judge(again, compute_metrics(again)) == found


AT_ITS_LIMIT = (
    "theatre=false",
    "plant={type: kinematic}",
    "task.duration_s=4",
    "task.radius_m=0.05",
    "task.start_m=[0.05, 0.55, 0.02]",
    "start.q_rad=[1.6029550, -0.5106133, -2.9570597, -1.4358331, -0.3720263, 1.2775577, 0.57]",
    "controller.limit_zone_rad=0",
)


def test_a_tip_given_up_at_a_joint_limit_completes_and_is_not_done():
    trace = simulate(load_scenario("circle_lwr4plus", controller="pinv", assignments=AT_ITS_LIMIT))
    metrics = compute_metrics(trace)
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    assert metrics["joint_limit_margin_min_rad"] == pytest.approx(0.0, abs=1e-3)
    assert metrics["tip_error_end_mm"] < 0.1, "it comes back to its path"
    found = judge(trace, metrics)
    assert not found.success
    assert found.reason == "tip_error_max_mm 5.61 exceeds 3, docs/safety.md, joint 3 at its limit"
    assert found.line() == f"NOT done: {found.reason}."


def test_motion_away_from_joint_limits_keeps_the_same_tip_on_its_path():
    keys = [*AT_ITS_LIMIT, "controller.limit_zone_rad=0.2"]
    trace = simulate(load_scenario("circle_lwr4plus", controller="pinv", assignments=keys))
    metrics = compute_metrics(trace)
    assert judge(trace, metrics).success
    assert metrics["tip_error_max_mm"] < 0.1
    assert metrics["joint_limit_margin_min_rad"] == pytest.approx(0.01, abs=1e-3), "where it begins"


def test_joints_at_their_limit_are_named_whether_or_not_the_task_was_done():
    found = verdict(run("circle_lwr4plus", {"q2_rad": 0.9901}))
    assert (found.success, found.reason) == (True, "the path was followed, joint 2 at its limit")
    assert verdict(run("circle_lwr4plus", {"q2_rad": 0.9899})).reason == "the path was followed"
    both = {"q2_rad": 0.995, "q5_rad": -1.0}
    found = verdict(run("circle_lwr4plus", both), tip_error_max_mm=5.0, rcm_error_max_mm=9.0)
    assert found.line() == (
        "NOT done: tip_error_max_mm 5 exceeds 3, docs/safety.md, joint 2 and joint 5 at their limit; "
        "rcm_error_max_mm 9 exceeds 5, docs/safety.md."
    )
