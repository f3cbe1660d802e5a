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

METRICS: dict[str, Metric] = {
    metric.name: metric
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
    for metric in group.METRICS
}


def compute_metrics(trace: Trace) -> dict[str, float | None]:
    """Every metric of `trace`; None where it is not defined, e.g. an RCM error without a trocar."""
    active = trace.active()
    return {
        name: _finite(metric.compute(trace if metric.whole else active)) for name, metric in METRICS.items()
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
