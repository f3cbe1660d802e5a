"""Roughness and size of the torques, on made traces and on a run, against formulas written another way."""

import itertools
import json
import math
import statistics
from dataclasses import replace

import numpy as np
import pytest

from surgsim.metrics.catalog import METRICS
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import simulate
from surgsim.trace.trace import Trace, TraceMeta

NAN = math.nan
ROUGHNESS = ("torque_rate_ratio_max", "torque_rate_over_fraction", "jerk_ratio_max")


def _value(trace, name):
    return METRICS[name].compute(trace)


def _limited(trace, **limits):
    given = {name: [float(x) for x in values] for name, values in limits.items()}
    meta = replace(trace.meta, limits={**trace.meta.limits, **given})
    return Trace(trace.data, trace.blocks, meta)


def _joints(rows, **changed):
    values = np.zeros((rows, 7))
    for joint, column in changed.items():
        values[:, int(joint[1:]) - 1] = column
    return values


def test_torque_rates_are_to_the_limit_of_each_joint(trace_of):
    tau = _joints(5, j2=[0.0, 1.0, 1.0, 1.0, 1.0], j5=[0.0, 0.0, -0.5, 0.1, 0.1])
    trace = _limited(trace_of(5, period_s=0.01, tau=tau), torque_rate=[200, 200, 200, 200, 40, 200, 200])
    # steps of at most 1.0, 0.5, 0.6 and 0 N m in 10 ms
    assert _value(trace, "torque_rate_ratio_max") == pytest.approx(60.0 / 40.0)
    assert _value(trace, "torque_rate_over_fraction") == pytest.approx(2 / 4)
    assert _value(trace, "torque_rate_median_nm_per_s") == pytest.approx(55.0)


def test_a_torque_that_is_held_at_its_rate_counts(trace_of):
    trace = _limited(trace_of(3, period_s=0.5, tau=_joints(3, j1=[0.0, 1.0, 2.5])), torque_rate=[2.0] * 7)
    assert _value(trace, "torque_rate_over_fraction") == pytest.approx(1.0)
    slower = _limited(trace_of(3, period_s=0.5, tau=_joints(3, j1=[0.0, 0.9, 2.4])), torque_rate=[2.0] * 7)
    assert _value(slower, "torque_rate_over_fraction") == pytest.approx(0.5)


def test_jerk_is_the_second_difference_of_the_velocity(trace_of):
    t = 0.01 * np.arange(6)
    trace = trace_of(6, period_s=0.01, v=_joints(6, j3=7.0 * t**2, j6=-3.0 * t**2))
    assert _value(_limited(trace, jerk=[100, 100, 28, 100, 100, 4, 100]), "jerk_ratio_max") == pytest.approx(
        1.5
    )


def test_without_a_published_limit_there_is_no_ratio_but_a_median(trace_of):
    trace = trace_of(4, tau=_joints(4, j1=[0.0, 1.0, 3.0, 6.0]), v=_joints(4))
    assert all(math.isnan(_value(trace, name)) for name in ROUGHNESS)
    assert _value(trace, "torque_rate_median_nm_per_s") == pytest.approx(2000.0)


@pytest.mark.parametrize("rows", [1, 2])
def test_short_traces_have_no_jerk_and_one_row_no_rate(trace_of, rows):
    trace = _limited(trace_of(rows, tau=_joints(rows), v=_joints(rows)), torque_rate=[1] * 7, jerk=[1] * 7)
    assert math.isnan(_value(trace, "jerk_ratio_max"))
    assert math.isnan(_value(trace, "torque_rate_ratio_max")) == (rows == 1)


def test_ticks_without_a_torque_are_left_out(trace_of):
    trace = trace_of(4, tau=_joints(4, j1=[3.0, 3.0, 3.0, NAN], j2=[4.0, 4.0, -12.0, 4.0]))
    trace = _limited(trace, torque_rate=[1000.0] * 7)
    assert _value(trace, "torque_rate_ratio_max") == pytest.approx(16.0)
    assert _value(trace, "torque_rate_over_fraction") == pytest.approx(1 / 2)
    assert _value(trace, "torque_peak_nm") == pytest.approx(12.0)
    assert _value(trace, "torque_total_mean_nm") == pytest.approx((5.0 + 5.0 + math.sqrt(153.0)) / 3)


def test_a_run_without_torques_has_none_of_these(trace_of):
    trace = _limited(trace_of(4, v=_joints(4)), torque_rate=[1.0] * 7)
    names = [name for name in METRICS if name.startswith("torque_")]
    assert len(names) == 6
    assert all(math.isnan(_value(trace, name)) for name in names)


def test_a_run_of_an_arm_with_published_limits():
    trace = simulate(load_scenario("circle_panda", assignments=("task.duration_s=0.3", "task.ramp_s=0.1")))
    tau, v, dt = trace.block("tau"), trace.block("v"), trace.meta.control_period_s
    fastest, jerk = [], 0.0
    for before, now in itertools.pairwise(tau):
        fastest.append(max(abs(b - a) / dt for a, b in zip(before, now, strict=True)))
    for k in range(1, len(v) - 1):
        acceleration = [(v[k + 1, j] - v[k, j]) / dt - (v[k, j] - v[k - 1, j]) / dt for j in range(7)]
        limits = (7500, 3750, 5000, 6250, 7500, 10000, 10000)  # the data sheet's, rad/s^3
        jerk = max(jerk, *(abs(a) / dt / most for a, most in zip(acceleration, limits, strict=True)))
    assert _value(trace, "torque_rate_ratio_max") == pytest.approx(max(fastest) / 1000.0)
    assert _value(trace, "torque_rate_over_fraction") == sum(f >= 1000.0 for f in fastest) / len(fastest)
    assert _value(trace, "torque_rate_median_nm_per_s") == pytest.approx(statistics.median(fastest))
    assert _value(trace, "jerk_ratio_max") == pytest.approx(jerk)
    assert _value(trace, "torque_peak_nm") == max(abs(x) for row in tau for x in row)
    sizes = [math.sqrt(math.fsum(x * x for x in row)) for row in tau]
    assert _value(trace, "torque_total_mean_nm") == pytest.approx(math.fsum(sizes) / len(sizes))


def test_what_is_not_published_is_not_in_the_trace(scenario):
    trace = simulate(scenario("task.duration_s=0.05", "task.ramp_s=0.01"))  # an LWR4+
    assert set(trace.meta.limits) == {"q_min", "q_max", "velocity", "acceleration", "torque"}
    text = trace.meta.to_json()
    json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))
    assert TraceMeta.from_json(text) == trace.meta
