"""How long the controller took: processor time of its thread, whatever else the machine does."""

import numpy as np

from surgsim.array import Array
from surgsim.metrics.metric import CHOICE, Metric
from surgsim.trace.trace import Trace


def _times(trace: Trace) -> Array:
    times = trace["control_time_s"]
    return times[np.isfinite(times)]


def control_time_percentile_us(trace: Trace, percentile: float) -> float:
    """Percentile of the controller's processor time per tick [us]."""
    times = _times(trace)
    return 1e6 * float(np.percentile(times, percentile)) if times.size else float("nan")


def deadline_miss_fraction(trace: Trace) -> float:
    """Fraction of ticks in which the controller's processor time was longer than its period."""
    times = _times(trace)
    return float(np.mean(times > trace.meta.control_period_s)) if times.size else float("nan")


METRICS = (
    Metric(
        name="control_time_p50_us",
        heading="time of a control tick, median [µs]",
        matters=10.0,
        matters_source=CHOICE,
        meaning="median processor time of the controller per tick",
        compute=lambda trace: control_time_percentile_us(trace, 50.0),
    ),
    Metric(
        name="control_time_p99_us",
        heading="time of a control tick, 99th percentile [µs]",
        matters=10.0,
        matters_source=CHOICE,
        meaning="99th percentile of the controller's processor time per tick",
        compute=lambda trace: control_time_percentile_us(trace, 99.0),
    ),
    Metric(
        name="deadline_miss_fraction",
        heading="ticks later than their period, share",
        matters=0.01,
        matters_source=CHOICE,
        meaning="fraction of ticks in which that was longer than the control period",
        compute=deadline_miss_fraction,
    ),
)
TIMING_METRICS = frozenset(metric.name for metric in METRICS)
"""Metrics that measure the machine, not the experiment."""
