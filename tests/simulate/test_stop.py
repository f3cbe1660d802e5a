"""Every outcome that stops a run: its shipped scenario ends in it, then the arm comes to rest and stays."""

import json

import numpy as np
import outside
import pytest

from surgsim.cli.main import main
from surgsim.control.external.given_commands import giving
from surgsim.control.failure import ControlFailure
from surgsim.errors import Outcome
from surgsim.metrics.catalog import compute_metrics
from surgsim.recording.read import read_recording
from surgsim.scenario.load import load_experiment, load_scenario, shipped
from surgsim.simulate.loop import Simulation, simulate
from surgsim.simulate.setup import prepare

STOPPING = [outcome for outcome in Outcome if outcome is not Outcome.COMPLETED]
NAMES = {outcome.name.lower() for outcome in STOPPING}
AT_REST_RAD_PER_S = 0.02
FACING = "start.posture_rad=[1.5708, 0.0, 0.0, -1.5708, 0.0, 1.8675, 0.0]"


@pytest.fixture(autouse=True)
def _an_external_controller_that_ends():
    """No scenario holds a command: that of `external_failed` is given here, and ends at its 500th request."""
    with giving({"mine": outside.command("ends", 500)}):
        yield


def _on_panda(name):
    """Overrides that put a scenario of the LWR4+ before the Panda: everything 10 cm out and 5 cm down."""
    s = load_scenario(f"safety/{name}")
    moved = ["robot.name=panda", FACING, "theatre=false"]
    if s.trocar is not None:
        moved.append(f"trocar.position_m={_shifted(s.trocar.position_m)}")
        moved.append(f"task.start_m={_shifted(s.task.start_m)}")
    return moved + [f"props.{i}.point_m={_shifted(p.point_m)}" for i, p in enumerate(s.props)]


def _shifted(point):
    return [point[0], round(point[1] + 0.1, 9), round(point[2] - 0.05, 9)]


def test_every_outcome_but_completion_has_a_scenario_of_its_name():
    assert set(shipped("safety")) == NAMES
    assert all(load_experiment(f"safety/{name}").name == name for name in NAMES)


@pytest.mark.parametrize("name", sorted(NAMES))
def test_its_scenario_ends_in_it_on_the_command_line_and_the_recording_says_so(name, tmp_path, capsys):
    words = ["run", f"safety/{name}", "--json", "--out", str(tmp_path / "run"), "--set", "theatre=false"]
    if name == "external_failed":
        words += ["--external", f"mine={outside.command('ends', 500)}"]
    assert main(words) == 1
    printed = json.loads(capsys.readouterr().out)
    assert printed["outcome"]["name"] == name
    assert printed["outcome"]["detail"]
    recorded = read_recording(tmp_path / "run")
    ending = recorded.trace.meta.ending
    assert ending.outcome.name.lower() == name
    assert ending.t_s == recorded.trace.active()["t_s"][-1] > 0.1
    stored = {key: value for key, value in printed["metrics"].items() if key.endswith("stop_distance_mm")}
    assert stored
    assert stored.items() <= compute_metrics(recorded.trace).items()


@pytest.mark.parametrize("robot", ["lwr4plus", "panda"])
@pytest.mark.parametrize("name", sorted(NAMES - {"arm_collision"}))
def test_a_stopped_arm_comes_to_rest_and_does_not_fall(name, robot):
    assignments = _on_panda(name) if robot == "panda" else ["theatre=false"]
    trace = simulate(load_scenario(f"safety/{name}", assignments=assignments))
    assert trace.meta.ending.outcome.name.lower() == name
    _assert_comes_to_rest(trace.stop())


def test_every_arm_of_a_run_that_is_stopped_comes_to_rest():
    trace = simulate(load_experiment("safety/arm_collision", assignments=["theatre=false"]))
    for arm in trace.arms:
        _assert_comes_to_rest(trace.of(arm).stop())


def _assert_comes_to_rest(stop):
    assert len(stop) == 501
    speed = np.abs(stop.block("v")).max(axis=1)
    assert speed[-1] < AT_REST_RAD_PER_S
    assert np.isfinite(stop.block("tau")[1:-1]).all()
    late = stop.block("wrist")[-100:, 2]
    assert np.ptp(late) < 1e-3  # a falling arm would drop 49 mm in this tenth of a second


def _let_go(setup, q, v, ticks):
    """Height lost by the wrist with the torque taken away, from the state of a stop's first row [m]."""
    plant = setup.plant
    plant.reset(q)
    plant.set_velocity(v)
    before = plant.truth().p_WR[2]
    for _ in range(ticks):
        plant.step(np.zeros(7), np.zeros(7))
    return before - plant.truth().p_WR[2]


def test_without_torque_the_same_arm_falls():
    """What the test above would see in a stop of category 0."""
    setup = prepare(load_scenario("safety/infeasible", assignments=["theatre=false"]))
    assert _let_go(setup, setup.q_start, np.zeros(7), 500) > 0.05


def test_the_stop_survives_a_delay_of_5_ms_and_unknown_friction(scenario):
    changes = (
        "safety.tip_error_max_m=1e-4",
        "task.radius_m=0.01",
        "disturbances=[{type: actuation_delay, delay_s: 0.005}, {type: joint_friction}]",
    )
    trace = simulate(scenario(*changes))
    assert trace.meta.ending.outcome is Outcome.TIP_LIMIT
    speed = np.abs(trace.stop().block("v")).max(axis=1)
    assert speed[-100:].max() < AT_REST_RAD_PER_S


def test_rows_of_the_stop_are_told_apart_and_change_no_other_metric(scenario):
    limit = "safety.tip_error_max_m=5e-5"
    stopped, ended = simulate(scenario(limit)), simulate(scenario(limit, "safety.stop=null"))
    assert stopped.active().block("q").tolist() == ended.block("q").tolist()
    assert len(stopped) == len(ended) + 500
    assert len(stopped.stop()) == 501
    assert len(ended.stop()) == 0
    assert ended.active() is ended
    with_stop, without = compute_metrics(stopped), compute_metrics(ended)
    timing = {name for name in without if name.endswith("_us") or name.startswith("deadline")}
    differing = {name for name in without if with_stop[name] != without[name]} - timing
    assert differing == {"stop_distance_mm"}
    assert without["stop_distance_mm"] is None
    tip = stopped.block("tip")[len(ended) - 1 :]
    assert with_stop["stop_distance_mm"] == 1e3 * np.linalg.norm(tip - tip[0], axis=1).max()


def test_a_duration_of_zero_is_no_stop(scenario):
    trace = simulate(scenario("safety.tip_error_max_m=5e-5", "safety.stop.duration_s=0"))
    assert trace.active() is trace


def test_a_completed_run_is_not_stopped(scenario):
    trace = simulate(scenario())
    assert trace["stopped"].tolist() == [0.0] * len(trace)


def _failing_at(ticks):
    def fail(tick, problem):
        if tick in ticks:
            raise ControlFailure(Outcome.INFEASIBLE, "made to fail")

    return fail


def _failing(scenario, asking, ticks, *changes):
    return Simulation(asking(prepare(scenario(*changes)), _failing_at(ticks))).run()


@pytest.mark.parametrize("plant", ["dynamic", "kinematic"])
def test_up_to_n_ticks_in_a_row_without_an_answer_are_bridged_by_braking(scenario, asking, plant):
    changes = ("safety.infeasible_ticks_max=3", f"plant.type={plant}")
    trace = _failing(scenario, asking, {100, 101, 102, 150}, *changes)
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    assert compute_metrics(trace)["infeasible_ticks"] == 4
    assert np.flatnonzero(trace["infeasible"]).tolist() == [100, 101, 102, 150]
    before, during = (np.linalg.norm(trace.block("qdot_ref")[k]) for k in (99, 102))
    assert during < before


def test_the_controller_takes_over_from_the_brake_without_a_kick(scenario, asking):
    """What it remembered from before the bridge would look like a sudden push."""
    changes = ("safety.infeasible_ticks_max=50", "task.hold_start_s=0.2", "disturbances=[{type: payload}]")
    setup = prepare(scenario(*changes, controller="rcm_inverse_dynamics"))
    traces = [Simulation(asking(setup, _failing_at(ticks))).run() for ticks in (set(), set(range(150, 160)))]
    calm, bridged = (np.abs(np.diff(trace.block("tau"), axis=0)).max(axis=1) for trace in traces)
    assert bridged[160:].max() < 3.0 * calm[150:].max()
    assert traces[1].meta.ending.outcome is Outcome.COMPLETED


def test_one_more_ends_the_run_as_infeasible(scenario, asking):
    trace = _failing(scenario, asking, {100, 101, 102, 103}, "safety.infeasible_ticks_max=3")
    ending = trace.meta.ending
    assert (ending.outcome, ending.t_s) == (Outcome.INFEASIBLE, pytest.approx(0.103))
    assert compute_metrics(trace)["infeasible_ticks"] == 4


def test_the_last_command_is_never_repeated(scenario, asking):
    trace = _failing(scenario, asking, set(range(100, 400)), "safety.infeasible_ticks_max=0")
    assert trace.meta.ending.t_s == pytest.approx(0.1)
    assert np.abs(trace.stop().block("v")[-1]).max() < 1e-3
