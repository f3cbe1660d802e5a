"""What the controller takes tip and shaft to be, beside what they are."""

import numpy as np
import pytest

from surgsim.control.failure import ControlFailure
from surgsim.errors import Outcome
from surgsim.metrics.catalog import METRICS, compute_metrics
from surgsim.models.arm import ArmModel
from surgsim.simulate.loop import Simulation, simulate
from surgsim.simulate.setup import prepare
from surgsim.trace.trace import Trace

PAIRS = [
    (f"{what}_error_{how}_mm", f"{what}_control_error_{how}_mm")
    for what in ("tip", "rcm")
    for how in ("rms", "max")
]
CALIBRATION = "disturbances=[{type: calibration_error}]"
NOISE = "disturbances=[{type: sensor_noise, position_std_rad: 1.0e-4, velocity_std_rad_per_s: 0.0}]"
CONTROLLERS = ["rcm_inverse_dynamics", "joint_impedance", "vprnn"]
"""The second one has its resolver evaluated at the joint reference."""


def distance_of_lines(p, axis, points):
    """Distance of `points` (rows, 3) from lines through `p` (rows, 3) along `axis` (rows, 3)."""
    reach = points - p
    along = (reach * axis).sum(axis=1, keepdims=True) / (axis * axis).sum(axis=1, keepdims=True)
    return np.linalg.norm(reach - along * axis, axis=1)


def nominal(arm, positions):
    """Tip (rows, 3) and shaft axis (rows, 3) of the nominal arm."""
    kins = [arm.kinematics(q) for q in positions]
    return np.array([kin.p_WT for kin in kins]), np.array([kin.R_WT[:, 2] for kin in kins])


@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("plant", ["dynamic", "kinematic"])
def test_of_an_ideal_arm_belief_and_truth_are_one(scenario, controller, plant):
    trace = simulate(scenario(f"plant={{type: {plant}}}", controller=controller))
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    np.testing.assert_allclose(trace.block("tip_believed"), trace.block("tip"), rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(trace["rcm_error_believed_m"], trace["rcm_error_m"], rtol=0.0, atol=1e-12)
    metrics = compute_metrics(trace)
    for true, control in PAIRS:
        assert metrics[control] == pytest.approx(metrics[true], abs=1e-9)


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_with_a_calibration_error_belief_is_the_nominal_arm_and_the_error_the_true_one(scenario, controller):
    short = scenario(CALIBRATION, controller=controller, seed=1)
    trace, calm = simulate(short), simulate(scenario(controller=controller))
    tip, axis = nominal(ArmModel(short.scene), trace.block("q"))
    np.testing.assert_allclose(trace.block("tip_believed"), tip, rtol=0.0, atol=1e-12)
    wanted = distance_of_lines(tip, axis, trace.block("trocar"))
    np.testing.assert_allclose(trace["rcm_error_believed_m"], wanted, rtol=0.0, atol=1e-12)
    ours, ideal = compute_metrics(trace), compute_metrics(calm)
    for true, control in PAIRS:
        assert ours[control] == pytest.approx(ideal[control], abs=0.02 + 0.1 * ideal[control])
        assert ours[true] > ideal[true]
    assert ours["tip_error_rms_mm"] > 0.5


@pytest.mark.parametrize("controller", ["rcm_inverse_dynamics", "joint_impedance"])
def test_with_noise_it_is_of_the_positions_that_are_measured(scenario, asking, controller):
    short, seen = scenario(NOISE, controller=controller, seed=3), []
    setup = prepare(short)
    trace = Simulation(asking(setup, lambda tick, problem: seen.append(setup.plant.state().q))).run()
    arm = ArmModel(short.scene)
    tip, axis = nominal(arm, seen)
    np.testing.assert_allclose(trace.block("tip_believed"), tip, rtol=0.0, atol=1e-12)
    wanted = distance_of_lines(tip, axis, trace.block("trocar"))
    np.testing.assert_allclose(trace["rcm_error_believed_m"], wanted, rtol=0.0, atol=1e-12)


def test_noise_blurs_it_as_the_jacobian_says(scenario):
    """The mean square of J n is std² trace(J Jᵀ)."""
    short = scenario(NOISE, controller="joint_impedance", seed=3)
    trace, arm = simulate(short), ArmModel(short.scene)
    off = trace.block("tip_believed") - trace.block("tip")
    jacobians = [arm.kinematics(q).Jv_WT for q in trace.block("q")]
    wanted = 1e-4 * np.sqrt(np.mean([np.trace(J @ J.T) for J in jacobians]))
    assert np.sqrt((off**2).sum(axis=1).mean()) == pytest.approx(wanted, rel=0.1)
    metrics = compute_metrics(trace)
    assert metrics["tip_control_error_rms_mm"] == pytest.approx(
        np.hypot(metrics["tip_error_rms_mm"], 1e3 * wanted), rel=0.1
    )


def test_the_rcm_error_is_from_the_port_that_the_controller_knows(scenario):
    error = "disturbances=[{type: trocar_calibration, error_m: [0.001, 0.0, 0.0]}]"
    trace = simulate(scenario(error, "task.duration_s=0.6", controller="rcm_inverse_dynamics"))
    axis = trace.block("tip") - trace.block("wrist")
    known = trace.block("trocar") + np.array([0.001, 0.0, 0.0])
    wanted = distance_of_lines(trace.block("tip"), axis, known)
    np.testing.assert_allclose(trace["rcm_error_believed_m"], wanted, rtol=0.0, atol=1e-12)
    assert trace["rcm_error_believed_m"][-1] < 2e-4 < 8e-4 < trace["rcm_error_m"][-1]


def test_without_a_trocar_there_is_no_rcm_error_to_believe(scenario):
    trace = simulate(scenario("plant={type: kinematic}", "trocar=null"))
    assert np.isnan(trace["rcm_error_believed_m"]).all()
    assert np.isfinite(trace.block("tip_believed")).all()
    metrics = compute_metrics(trace)
    assert metrics["rcm_control_error_rms_mm"] is None is metrics["rcm_control_error_max_mm"]
    assert metrics["tip_control_error_max_mm"] == pytest.approx(metrics["tip_error_max_mm"], abs=1e-9)


def test_in_the_tick_of_a_limit_and_in_the_stop_the_controller_is_not_asked(scenario):
    trace = simulate(
        scenario("safety.tip_error_max_m=1.0e-7", "safety.stop={}", controller="joint_impedance")
    )
    run = trace.active()
    assert trace.meta.ending.outcome is Outcome.TIP_LIMIT
    assert len(trace) > len(run) > 2
    for block in ("tip_believed", "rcm_error_believed"):
        assert np.isfinite(run.block(block)[:-1]).all()
        assert np.isnan(trace.block(block)[len(run) - 1 :]).all()
    before = Trace(run.data[:-1], run.blocks, run.meta)
    metrics, wanted = compute_metrics(trace), compute_metrics(before)
    for true, control in PAIRS:
        assert metrics[control] == pytest.approx(wanted[true], abs=1e-9)


def test_a_tick_without_an_answer_has_a_belief(scenario, asking):
    """It is bridged by braking; what the controller measured is known."""

    def fail(tick, problem):
        if tick in (100, 101):
            raise ControlFailure(Outcome.INFEASIBLE, "made to fail")

    trace = Simulation(asking(prepare(scenario("safety.infeasible_ticks_max=3")), fail)).run()
    assert np.flatnonzero(trace["infeasible"]).tolist() == [100, 101]
    np.testing.assert_allclose(trace.block("tip_believed"), trace.block("tip"), rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(trace["rcm_error_believed_m"], trace["rcm_error_m"], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("columns", "expected"),
    [
        ({"tip_believed": [[0.003, 0, 0], [0, 0.004, 0]], "tip_ref": [[0, 0, 0]] * 2}, [12.5**0.5, 4.0]),
        ({"tip_believed": [[0.003, 0, 0], [np.nan] * 3], "tip_ref": [[0, 0, 0]] * 2}, [3.0, 3.0]),
        ({"tip_believed": [[np.nan] * 3] * 2, "tip_ref": [[0, 0, 0]] * 2}, [np.nan, np.nan]),
    ],
)
def test_control_errors_of_the_tip(trace_of, columns, expected):
    trace = trace_of(2, **columns)
    found = [METRICS[f"tip_control_error_{how}_mm"].compute(trace) for how in ("rms", "max")]
    assert found == pytest.approx(expected, nan_ok=True)


def test_a_trace_from_before_the_columns_has_no_control_errors(trace_of):
    trace = trace_of(2, tip_error=0.001)
    kept = [block for block in trace.blocks if "believed" not in block.name]
    old = Trace(np.hstack([trace.block(block.name) for block in kept]), kept, trace.meta)
    metrics = compute_metrics(old)
    assert [metrics[control] for _, control in PAIRS] == [None] * 4
    assert metrics["tip_error_max_mm"] == pytest.approx(1.0)
