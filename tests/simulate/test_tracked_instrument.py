"""What a tracked instrument is worth: the true errors of runs with a calibration error."""

from dataclasses import replace

import numpy as np
import pytest

from surgsim.control.decision import forget
from surgsim.errors import Outcome
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import Simulation, simulate
from surgsim.simulate.setup import prepare

RIGID = {"controller": "rcm_inverse_dynamics", "drive": "ideal"}
ELASTIC = {"controller": "rcm_elastic_dynamics", "drive": "real"}
BOTH = pytest.mark.parametrize("arm", [RIGID, ELASTIC], ids=["ideal", "real"])
TRACKED = "{type: tracked}"
FOLLOWS = (
    "{type: tracked, base_position_m: 0, base_angle_rad: 0, link_position_m: 0, link_angle_rad: 0, "
    "joint_offset_rad: 0, tool_position_m: 2.0e-3, tool_angle_rad: 2.0e-3, tool_walk_m_per_sqrt_s: 1.0e-4, "
    "tool_walk_rad_per_sqrt_s: 1.0e-4}"
)


def run(arm, seed, *, instrument=TRACKED, tracker="", duration_s=11.0, others=""):
    """The trace of a circle with errors of the geometry and a tracked instrument."""
    assignments = (
        f"task.duration_s={duration_s}",
        f"robot.drive={arm['drive']}",
        f"controller.instrument={instrument}",
        f"disturbances=[{{type: calibration_error}}, {{type: instrument_tracker{tracker}}}{others}]",
    )
    made = load_scenario("circle_lwr4plus", controller=arm["controller"], assignments=assignments, seed=seed)
    trace = simulate(made)
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    return trace


def errors_mm(trace, since_s=10.0):
    """RMS of the true tip and RCM errors from a time on [mm]."""
    late = trace["t_s"] >= since_s
    return [1e3 * np.sqrt(np.mean(trace[name][late] ** 2)) for name in ("tip_error_m", "rcm_error_m")]


@BOTH
@pytest.mark.parametrize("seed", [0, 1])
def test_true_errors_fall_below_a_twentieth_of_a_millimetre(arm, seed):
    nominal, tracked = (run(arm, seed, instrument=kind) for kind in ("{type: nominal}", TRACKED))
    assert min(errors_mm(nominal)) > 0.5
    assert max(errors_mm(tracked)) < 0.05


def test_what_is_believed_is_near_the_truth_then():
    trace = run(RIGID, 2)
    late = trace["t_s"] >= 10.0
    off = np.linalg.norm(trace.block("tip_believed") - trace.block("tip"), axis=1)
    assert off[0] > 5e-4
    assert np.sqrt(np.mean(off[late] ** 2)) < 5e-5


@BOTH
def test_a_tracker_that_is_lost_has_taught_enough(arm):
    assert max(errors_mm(run(arm, 1, tracker=", lost_after_s: 3.0"))) < 0.1


def test_a_field_and_the_port_s_own_error_stay():
    port = ", {type: trocar_calibration, error_m: [5.0e-5, 5.0e-5, 5.0e-5]}"
    found = errors_mm(run(RIGID, 0, tracker=", field_m: 1.0e-4", others=port))
    assert 0.02 < max(found) < 0.25


def test_an_instrument_that_is_followed_alone_is_worse_but_good():
    assert max(errors_mm(run(RIGID, 0, instrument=FOLLOWS))) < 0.1


def test_a_late_tracker_costs_nothing_where_the_arm_is_slow():
    prompt, late = (errors_mm(run(RIGID, 0, tracker=keys)) for keys in ("", ", delay_s: 0.05"))
    assert max(late) < 0.05
    np.testing.assert_allclose(late, prompt, rtol=0.5)


def test_a_library_with_a_model_of_its_own_is_corrected_too():
    """mink solves what pinv does, and would pull towards the nominal tip with the correction over a tick."""
    mink, pinv = (run({"controller": name, "drive": "ideal"}, 0, duration_s=6.0) for name in ("mink", "pinv"))
    for name in ("tip", "tip_believed"):
        np.testing.assert_allclose(mink.block(name), pinv.block(name), rtol=0.0, atol=2e-5)
    assert errors_mm(mink, 3.0)[0] < 0.2


def test_without_a_tracker_the_estimator_changes_no_bit(scenario):
    disturbances = "disturbances=[{type: calibration_error}, {type: sensor_noise}]"
    nominal, tracked = (
        simulate(scenario(disturbances, f"controller.instrument={kind}", controller=controller))
        for kind in ("{type: nominal}", TRACKED)
        for controller in ("rcm_inverse_dynamics",)
    )
    kept = [k for k, name in enumerate(nominal.columns) if name != "control_time_s"]
    np.testing.assert_array_equal(nominal.data[:, kept], tracked.data[:, kept])


@pytest.mark.parametrize("controller", ["joint_impedance", "rcm_inverse_dynamics", "mink"])
def test_a_second_run_begins_without_what_the_first_one_learnt(scenario, controller):
    disturbances = "disturbances=[{type: calibration_error}, {type: instrument_tracker}]"
    setup = prepare(scenario(disturbances, f"controller.instrument={TRACKED}", controller=controller))
    first, again = Simulation(setup).run(), Simulation(setup).run()
    assert first.equals(again)


class InPython:
    """An instrument estimator that is a Python object, and does what a kernel does."""

    def __init__(self, kernel):
        self.inner = kernel

    def start(self, problem):
        return self.inner.start(problem)

    def step(self, problem, memory):
        return self.inner.step(problem, memory)


SEEN = ("disturbances=[{type: calibration_error}, {type: instrument_tracker, delay_s: 0.005}]",)
SEEN += (f"controller.instrument={TRACKED}",)


@pytest.mark.parametrize("controller", ["joint_impedance", "rcm_inverse_dynamics"])
def test_an_estimator_in_python_gives_the_run_of_the_kernel(scenario, controller):
    made = scenario(*SEEN, controller=controller)
    setup = prepare(made)
    parts = setup.controller.parts
    parts = replace(parts, instrument=InPython(parts.instrument))
    trace = Simulation(replace(setup, controller=setup.controller.with_parts(parts))).run()
    assert trace.equals(simulate(made))
    assert np.ptp(trace["tip_believed_x_m"] - trace["tip_x_m"]) > 1e-5


def test_what_was_learnt_outlives_a_tick_without_an_answer(scenario):
    setup = prepare(scenario(*SEEN, controller="rcm_inverse_dynamics"))
    simulation, control = Simulation(setup), setup.controller.control
    for _ in range(250):
        simulation.tick()
    before = control.correction.copy()
    forget(control)  # as the loop does where there is none
    simulation.tick()
    assert np.abs(before).max() > 1e-4
    np.testing.assert_allclose(control.correction, before, rtol=0.05, atol=1e-6)
    setup.controller.reset()
    assert not control.correction.any()
    assert not control.measured.corrected
