"""Whole runs: the same scenario gives the same trace, the trace says what happened, the error converges."""

import math
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

from surgsim.control.failure import ControlFailure
from surgsim.errors import Outcome, ScenarioError
from surgsim.simulate.loop import Simulation, simulate
from surgsim.simulate.setup import prepare

KINEMATIC = ("plant={type: kinematic}",)
PAYLOAD = ("disturbances=[{type: payload}]",)


@pytest.fixture(scope="module")
def trace(scenario):
    return simulate(scenario())


def test_the_same_scenario_gives_the_same_trace_bit_for_bit(scenario, trace):
    assert simulate(scenario()).equals(trace)
    assert not simulate(scenario(*PAYLOAD)).equals(trace)


def test_control_time_is_the_controllers_and_not_what_else_the_machine_does(scenario, asking):
    waits = iter([_nothing, time.sleep, _work])  # the first tick may compile the kernels of a part in Python
    setup = asking(prepare(scenario()), lambda tick, problem: next(waits, _nothing)(0.05))
    _, slept, worked, *_ = Simulation(setup).run()["control_time_s"]
    assert slept < 0.04, "the time that the thread was not running is in it"
    assert worked >= 0.05


def test_the_time_of_kernels_alone_is_taken_in_every_eighth_tick(trace, scenario, asking):
    timed = np.isfinite(trace["control_time_s"])
    assert timed[::8].all()
    assert timed.sum() == len(timed[::8])
    setup = asking(prepare(scenario("task.duration_s=1")), lambda tick, problem: None)
    assert np.isfinite(Simulation(setup).run()["control_time_s"]).all()


def _nothing(length_s):
    pass


def _work(length_s):
    end = time.thread_time() + length_s
    while time.thread_time() < end:
        pass


def test_a_prepared_scenario_can_be_run_again(scenario, trace):
    setup = prepare(scenario())
    assert Simulation(setup).run().equals(Simulation(setup).run())


def test_another_process_gives_the_same_trace(scenario, trace, tmp_path):
    (tmp_path / "scenario.json").write_text(scenario().model_dump_json())
    code = (
        "import sys, numpy as np; from surgsim.scenario.schema import Scenario; "
        "from surgsim.simulate.loop import simulate; "
        "text = open('scenario.json').read(); "
        "np.save('data.npy', simulate(Scenario.model_validate_json(text, strict=True)).data)"
    )
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, timeout=100)
    keep = [i for i, name in enumerate(trace.columns) if name != "control_time_s"]
    np.testing.assert_array_equal(np.load(tmp_path / "data.npy")[:, keep], trace.data[:, keep])


def test_a_row_a_tick_from_zero_to_the_end(trace):
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    assert trace.meta.ending.t_s == pytest.approx(0.3)
    np.testing.assert_allclose(trace["t_s"], np.arange(301) * 0.001, atol=1e-12)
    timed = [k for k, name in enumerate(trace.columns) if name != "control_time_s"]
    assert np.isfinite(trace.data[:, timed]).all()


def test_derived_columns_follow_from_the_points(trace):
    tip, wrist, trocar = trace.block("tip"), trace.block("wrist"), trace.block("trocar")
    np.testing.assert_allclose(trace["tip_error_m"], np.linalg.norm(tip - trace.block("tip_ref"), axis=1))
    axis = tip - wrist
    along = np.sum((trocar - wrist) * axis, axis=1) / np.sum(axis * axis, axis=1)
    nearest = wrist + along[:, None] * axis
    np.testing.assert_allclose(trace["rcm_error_m"], np.linalg.norm(nearest - trocar, axis=1), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(axis, axis=1), 0.4, atol=1e-9)


def test_the_torque_is_the_sum_of_its_terms_and_the_reference_the_sum_of_its_velocities(trace):
    terms = [block.name for block in trace.blocks if block.name.startswith("tau_")]
    assert terms == ["tau_tip_", "tau_rcm_", "tau_joint_", "tau_bias_"]
    np.testing.assert_allclose(trace.block("tau"), sum(trace.block(name) for name in terms), atol=1e-10)
    steps = 0.001 * np.cumsum(trace.block("qdot_ref"), axis=0)
    np.testing.assert_allclose(trace.block("q_ref")[1:], trace.block("q")[0] + steps[:-1], atol=1e-12)


def test_torque_is_recorded_as_it_acts_cut_at_the_limits(scenario):
    changes = ("controller.torque_law.joint_stiffness_nm_per_rad=[8e5, 8e5, 8e5, 8e5, 8e5, 8e5, 8e5]",)
    off = ("safety={rcm_error_max_m: null, stop_at_joint_limit: false, stop_at_velocity_limit: false}",)
    trace = simulate(scenario(*changes, *off))
    limit = np.array(trace.meta.limits["torque"])
    assert trace["saturated_joints"].max() >= 1
    assert np.abs(trace.block("tau") / limit).max() == 1.0


def test_on_the_kinematic_plant_there_is_no_torque_and_velocities_are_followed(scenario):
    trace = simulate(scenario(*KINEMATIC))
    assert np.isnan(trace.block("tau")).all()
    assert np.isnan(trace["saturated_joints"]).all()
    q, qdot = trace.block("q"), trace.block("qdot_ref")
    np.testing.assert_allclose(np.diff(q, axis=0), 0.001 * qdot[:-1], atol=1e-14)
    np.testing.assert_array_equal(trace.block("v")[1:], qdot[:-1])


def test_on_the_kinematic_plant_the_errors_fall_with_the_period_at_first_order(scenario):
    def errors(period):
        times = f"simulation={{timestep_s: {period}, control_period_s: {period}}}"
        longer = ("task.radius_m=0.02", "task.duration_s=1.6", "task.ramp_s=0.5")
        trace = simulate(scenario(*KINEMATIC, *longer, times))
        return np.array([trace["tip_error_m"].max(), trace["rcm_error_m"].max()])

    coarse, middle, fine = errors(0.008), errors(0.004), errors(0.002)
    assert (fine > 1e-9).all()
    np.testing.assert_allclose(coarse / middle, 2.0, atol=0.2)
    np.testing.assert_allclose(middle / fine, 2.0, atol=0.2)


def test_control_ticks_may_be_rarer_than_simulation_steps(scenario):
    trace = simulate(scenario("simulation={timestep_s: 0.0005, control_period_s: 0.002}"))
    np.testing.assert_allclose(np.diff(trace["t_s"]), 0.002, atol=1e-12)
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    assert trace["tip_error_m"].max() < 1e-3


def test_a_control_period_that_is_no_multiple_of_the_timestep_is_refused(scenario):
    text = "control_period_s 0.0025 must be a whole multiple of timestep_s 0.001, not 2.5 times it"
    with pytest.raises(ScenarioError, match=text):
        scenario("simulation={timestep_s: 0.001, control_period_s: 0.0025}")


def test_progress_is_told_with_the_whole_duration(scenario):
    told = []
    simulate(scenario(), lambda *call: told.append(call))
    assert told[-1] == (pytest.approx(0.3), pytest.approx(0.3))


class NotFinite:
    """A torque law in Python whose torque is not finite at one tick."""

    terms = ("joint",)

    def __init__(self, tick):
        self.count, self.tick = -1, tick

    def start(self, problem):
        return None

    def torque(self, problem, memory):
        self.count += 1
        torque = problem.dyn.bias - 5.0 * problem.v
        return (torque if self.count != self.tick else np.full(7, np.nan))[None], None


def _run_with_law(scenario, law):
    setup = prepare(scenario())
    parts = replace(setup.controller.parts, law=law)
    return Simulation(replace(setup, controller=setup.controller.with_parts(parts))).run()


def _raise(tick, problem):
    if tick == 7:
        raise ControlFailure(Outcome.INFEASIBLE, "no joint velocity meets the rows")


def test_a_controller_s_failure_ends_the_run_as_its_outcome(scenario, asking):
    trace = Simulation(asking(prepare(scenario()), _raise)).run()
    ending = trace.meta.ending
    assert (ending.outcome, ending.detail) == (Outcome.INFEASIBLE, "no joint velocity meets the rows")
    assert ending.t_s == pytest.approx(0.007)
    run = trace.active()
    assert len(run) == 8
    assert np.isfinite(trace.block("q")).all()
    assert np.isnan(run.block("qdot_ref")[-1]).all()
    assert np.isfinite(run.block("qdot_ref")[:-1]).all()
    assert run["infeasible"].tolist() == [0.0] * 7 + [1.0]


@pytest.mark.parametrize("tick", [0, 5])
def test_a_torque_that_is_not_finite_never_reaches_the_plant(scenario, tick):
    trace = _run_with_law(scenario, NotFinite(tick))
    ending = trace.meta.ending
    assert (ending.outcome, ending.detail) == (Outcome.DIVERGED, "torque is not finite")
    assert ending.t_s == pytest.approx(0.001 * tick)
    assert np.isfinite(trace.block("q")).all()


def test_a_torque_that_is_not_finite_at_the_last_tick_is_no_completion(scenario):
    trace = _run_with_law(scenario, NotFinite(300))
    assert trace.meta.ending.outcome is Outcome.DIVERGED


def test_the_literal_euler_network_fails_as_the_stability_limit_says(scenario):
    longer = ("task.duration_s=2", "task.hold_end_s=1", "controller.resolver.integration=euler")
    trace = simulate(scenario(*KINEMATIC, *longer))
    ending = trace.meta.ending
    assert (ending.outcome, ending.detail) == (
        Outcome.DIVERGED,
        "VPRNN: a joint velocity exceeds 1e12 rad/s",
    )
    assert math.log(2.0) < ending.t_s < 2.0
    stable = trace["resolver_residual_m_per_s"][20:650]
    assert stable.max() < 1e-2
