"""All metrics, and their values for a trace."""

import math

from surgsim.metrics import (
    accuracy,
    dexterity,
    effort,
    force,
    optimality,
    peg_and_ring,
    smoothness,
    stopping,
    teleoperation,
    timing,
)
from surgsim.metrics.metric import Metric
from surgsim.trace.trace import Trace

GROUPS: tuple[tuple[Metric, ...], ...] = tuple(
    tuple(group.METRICS)
    for group in (
        accuracy,
        dexterity,
        optimality,
        effort,
        smoothness,
        force,
        stopping,
        peg_and_ring,
        teleoperation,
        timing,
    )
)
"""Metrics of one subject, in the order in which they are printed."""

METRICS: dict[str, Metric] = {metric.name: metric for group in GROUPS for metric in group}


def compute_metrics(trace: Trace) -> dict[str, float | None]:
    """Every metric of `trace`; None where it is not defined, e.g. an RCM error without a trocar."""
    active = trace.active()
    return {
        name: _finite(metric.compute(trace if metric.whole else active)) for name, metric in METRICS.items()
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
