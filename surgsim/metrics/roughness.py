"""How rough the command is: how fast torques change, and how jerky the joints move.

Arms that publish limits of both refuse a command beyond them, whatever its accuracy.
"""

import math

import numpy as np

from surgsim.array import Array
from surgsim.metrics.metric import CHOICE, Metric
from surgsim.trace.trace import Trace


def torque_rates(trace: Trace) -> Array:
    """|tau_k - tau_{k-1}| / dt of every joint (m, n) [N m/s]; ticks without a torque are left out."""
    rates = np.abs(np.diff(trace.block("tau"), axis=0)) / trace.meta.control_period_s
    return rates[np.isfinite(rates).all(axis=1)]


def torque_rate_ratio_max(trace: Trace) -> float:
    """Largest |tau_k - tau_{k-1}| / dt over its limit; NaN where none is published."""
    return _largest(torque_rates(trace), trace, "torque_rate")


def torque_rate_over_fraction(trace: Trace) -> float:
    """Share of ticks in which a joint's torque changes by its limit or more; NaN where there is none."""
    limit, rates = trace.meta.limits.get("torque_rate"), torque_rates(trace)
    if limit is None or not rates.size:
        return math.nan
    return float(np.mean((rates > (1.0 - 1e-6) * np.array(limit)).any(axis=1)))


def torque_rate_median_nm_per_s(trace: Trace) -> float:
    """Median over ticks of the fastest joint's |tau_k - tau_{k-1}| / dt [N m/s]."""
    rates = torque_rates(trace)
    return float(np.median(rates.max(axis=1))) if rates.size else math.nan


def jerk_ratio_max(trace: Trace) -> float:
    """Largest |v_{k+1} - 2 v_k + v_{k-1}| / dt^2 of a joint over its limit; NaN where none is published."""
    jerk = np.abs(np.diff(trace.block("v"), n=2, axis=0)) / trace.meta.control_period_s**2
    return _largest(jerk[np.isfinite(jerk).all(axis=1)], trace, "jerk")


def _largest(values: Array, trace: Trace, limit: str) -> float:
    """Largest of `values` (m, n) over the limit of that name, NaN without one."""
    if limit not in trace.meta.limits or not values.size:
        return math.nan
    return float(np.max(values / np.array(trace.meta.limits[limit])))


METRICS = (
    Metric(
        name="torque_rate_ratio_max",
        heading="change of joint torque over its limit, largest",
        matters=0.01,
        matters_source=CHOICE,
        meaning="largest change of a joint torque from tick to tick, over its limit",
        compute=torque_rate_ratio_max,
    ),
    Metric(
        name="torque_rate_over_fraction",
        heading="ticks with a torque changing beyond its limit, share",
        matters=0.01,
        matters_source=CHOICE,
        meaning="fraction of ticks in which a joint torque changes as fast as its limit or faster",
        compute=torque_rate_over_fraction,
    ),
    Metric(
        name="torque_rate_median_nm_per_s",
        heading="change of joint torque, median [N m/s]",
        matters=1.0,
        matters_source=CHOICE,
        meaning="median over ticks of the fastest change of a joint torque, N m/s",
        compute=torque_rate_median_nm_per_s,
    ),
    Metric(
        name="jerk_ratio_max",
        heading="joint jerk over its limit, largest",
        matters=0.01,
        matters_source=CHOICE,
        meaning="largest jerk of a joint, over its limit",
        compute=jerk_ratio_max,
    ),
)
