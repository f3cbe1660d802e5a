"""Every metric on made traces whose values are known."""

import math
from dataclasses import replace

import numpy as np
import pytest

from surgsim.errors import Outcome
from surgsim.metrics.catalog import METRICS, compute_metrics, evaluate
from surgsim.metrics.metric import Undefined
from surgsim.metrics.timing import TIMING_METRICS
from surgsim.simulate.loop import simulate

NAN = math.nan


def _value(trace, name):
    return METRICS[name].compute(trace)


CASES = [
    ("tip_error_rms_mm", {"tip_error": [0.003, 0.004, 0.0, 0.0]}, 2.5),
    ("tip_error_max_mm", {"tip_error": [0.003, 0.004, 0.0, 0.0]}, 4.0),
    ("rcm_error_rms_mm", {"rcm_error": [0.006, 0.0, 0.008, 0.0]}, 5.0),
    ("rcm_error_max_mm", {"rcm_error": [0.006, 0.0, 0.008, 0.0]}, 8.0),
    ("rcm_control_error_rms_mm", {"rcm_error_believed": [0.006, 0.0, 0.008, 0.0]}, 5.0),
    ("rcm_control_error_max_mm", {"rcm_error_believed": [0.006, NAN, 0.008, 0.0]}, 8.0),
    ("manipulability_mean", {"manipulability": [0.1, 0.2, 0.3, 0.4]}, 0.25),
    ("manipulability_min", {"manipulability": [0.3, 0.2, 0.3, 0.4]}, 0.2),
    ("resolver_residual_rms", {"resolver_residual": [0.3, 0.4, 0.0, 0.0]}, 0.25),
    ("resolver_residual_rms", {"resolver_residual": [0.3, 0.4, NAN, NAN]}, math.sqrt(0.125)),
    ("saturated_fraction", {"saturated_joints": [0, 3, 1, 0]}, 0.5),
    ("saturated_fraction", {"saturated_joints": [0, 3, 1, NAN]}, 2.0 / 3.0),
    ("control_time_p50_us", {"control_time": [1e-6, 2e-6, 3e-6, NAN]}, 2.0),
    ("control_time_p99_us", {"control_time": [1e-6, 1e-6, 1e-6, 2e-6]}, 1.97),
    ("deadline_miss_fraction", {"control_time": [0.5e-3, 1.5e-3, 2e-3, 0.1e-3]}, 0.5),
]


@pytest.mark.parametrize(("name", "columns", "expected"), CASES)
def test_value(trace_of, name, columns, expected):
    assert _value(trace_of(4, **columns), name) == pytest.approx(expected, rel=1e-9)


def test_every_metric_is_unique_named_with_its_unit_and_explained():
    assert all(name == metric.name and metric.meaning for name, metric in METRICS.items())
    assert set(METRICS) > TIMING_METRICS
    assert all(name.endswith(("_us", "_fraction")) for name in TIMING_METRICS)


def _joints(rows, **changed):
    values = np.zeros((rows, 7))
    for joint, column in changed.items():
        values[:, int(joint[1:]) - 1] = column
    return values


def test_joint_limit_margin_is_the_smallest_to_either_side_and_negative_outside(trace_of):
    name = "joint_limit_margin_min_rad"  # range -2 to 2
    assert _value(trace_of(2, q=_joints(2, j3=[1.0, -1.7])), name) == pytest.approx(0.3)
    assert _value(trace_of(2, q=_joints(2, j5=[1.9, 0.0])), name) == pytest.approx(0.1)
    assert _value(trace_of(2, q=_joints(2, j7=[0.0, 2.5])), name) == pytest.approx(-0.5)


def test_ratios_are_to_the_limit_of_each_joint(trace_of):
    trace = trace_of(3, v=_joints(3, j2=[0.3, -1.5, 0]), tau=_joints(3, j4=[0, -4.0, NAN]))
    assert _value(trace, "joint_velocity_ratio_max") == pytest.approx(0.5)
    assert _value(trace, "torque_ratio_max") == pytest.approx(0.8)


CONVERGENCE = [
    ([0.0009] * 4, [0.004] * 4, 0.0),
    ([0.01, 0.0011, 0.001, 0.0], [0.0] * 4, 0.2),
    ([0.0] * 4, [0.0, 0.0051, 0.005, 0.0], 0.2),
    ([0.01, 0.0, 0.01, 0.0], [0.0] * 4, 0.3),
    ([0.01, 0.0, 0.0, 0.0], [NAN] * 4, 0.1),
    ([0.0, 0.0, 0.0, 0.01], [0.0] * 4, NAN),
    ([0.0] * 4, [0.0, 0.0, 0.0, 0.006], NAN),
]


@pytest.mark.parametrize(("tip", "rcm", "expected"), CONVERGENCE)
def test_convergence_is_the_last_time_of_coming_inside_1_mm_and_5_mm(trace_of, tip, rcm, expected):
    trace = trace_of(4, period_s=0.1, tip_error=tip, rcm_error=rcm)
    assert _value(trace, "convergence_time_s") == pytest.approx(expected, nan_ok=True)


def test_a_run_that_ends_in_nan_did_not_converge(trace_of):
    trace = trace_of(4, tip_error=[0.01, 0.01, 0.01, NAN], rcm_error=[0.0] * 4, outcome=Outcome.DIVERGED)
    assert math.isnan(_value(trace, "convergence_time_s"))


def test_what_a_run_does_not_define_is_none(scenario):
    trace = simulate(scenario("plant={type: kinematic}", "trocar=null", "task.duration_s=0.2"))
    metrics = compute_metrics(trace)
    assert list(metrics) == list(METRICS)
    undefined = {name for name, value in metrics.items() if value is None}
    assert {"rcm_error_rms_mm", "rcm_error_max_mm", "torque_ratio_max", "saturated_fraction"} <= undefined
    defined = {name: value for name, value in metrics.items() if value is not None}
    assert {"tip_error_rms_mm", "convergence_time_s", "manipulability_mean", "sparc"} <= set(defined)
    assert all(math.isfinite(value) for value in defined.values())


def test_a_trace_of_one_row_has_metrics(trace_of):
    trace = trace_of(1, tip_error=0.002)
    assert _value(trace, "tip_error_max_mm") == pytest.approx(2.0)
    assert math.isnan(_value(trace, "sparc"))


def _raising(error):
    def compute(trace):
        raise error

    return compute


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (Undefined("the arm is singular"), "the arm is singular"),
        (np.linalg.LinAlgError("no\n inverse"), "LinAlgError: no inverse"),
        (KeyError("q8_rad"), "KeyError: 'q8_rad'"),
    ],
)
def test_a_metric_that_raises_is_none_with_its_reason_and_costs_no_other(
    trace_of, monkeypatch, error, reason
):
    trace = trace_of(4, tip_error=[0.003, 0.004, 0.0, 0.0])
    plain = evaluate(trace)
    monkeypatch.setitem(METRICS, "sparc", replace(METRICS["sparc"], compute=_raising(error)))
    found = evaluate(trace)
    assert found.undefined == {**plain.undefined, "sparc": reason}
    assert found.values == {**plain.values, "sparc": None}
    assert compute_metrics(trace) == found.values
