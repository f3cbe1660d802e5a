"""All metrics, and their values for a trace."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from surgsim.metrics import (
    accuracy,
    dexterity,
    effort,
    force,
    operating,
    optimality,
    peg_and_ring,
    roughness,
    smoothness,
    stopping,
    teleoperation,
    timing,
    transfers,
)
from surgsim.metrics.metric import Metric, Undefined
from surgsim.metrics.outside import outside_metrics
from surgsim.trace.trace import Trace

_MODULES = (
    accuracy,
    dexterity,
    optimality,
    effort,
    roughness,
    smoothness,
    force,
    stopping,
    peg_and_ring,
    transfers,
    teleoperation,
    operating,
    timing,
)
SHIPPED = {metric.name: module for module in _MODULES for metric in module.METRICS}
"""Modules of the metrics that are not of other packages, by the metrics' names."""
_outside = tuple(outside_metrics(SHIPPED).values())
GROUPS: tuple[tuple[Metric, ...], ...] = (
    *(tuple(module.METRICS) for module in _MODULES),
    *([_outside] if _outside else []),
)
"""Metrics of one subject, in the order in which they are printed; last those of other packages."""

_LONGEST_REASON = 300
METRICS: dict[str, Metric] = {metric.name: metric for group in GROUPS for metric in group}


@dataclass(frozen=True, kw_only=True)
class Evaluation:
    """Metrics of a trace.

    Attributes:
        values: Every metric; None where the trace does not define it, e.g. an RCM error without a trocar.
        undefined: Why, for each metric that could not be computed: the error that it raised.
        broken: Those of them that raised something else than `Undefined`: a bug.
    """

    values: Mapping[str, float | None]
    undefined: Mapping[str, str]
    broken: frozenset[str] = frozenset()

    def missing(self, stored: Mapping[str, float | None]) -> dict[str, str]:
        """Why, for each metric that has a value in `stored` and cannot be computed here."""
        return {
            name: reason
            for name, reason in self.undefined.items()
            if name not in self.broken and stored.get(name) is not None
        }


def evaluate(trace: Trace) -> Evaluation:
    """Compute every metric of `trace`; one that raises is None, and costs no other.

    Of several arms every metric of each, the arm's name and `_` before the metric's.
    """
    if trace.arms:
        return _joined({arm: evaluate(trace.of(arm)) for arm in trace.arms})
    active = trace.active()
    values: dict[str, float | None] = {}
    undefined: dict[str, str] = {}
    broken: set[str] = set()
    for name, metric in METRICS.items():
        try:
            values[name] = _finite(metric.compute(trace if metric.whole else active))
        except Exception as error:  # whatever it is: the run is done, and is not to be lost
            values[name], undefined[name] = None, _reason(error)
            if not isinstance(error, Undefined):
                broken.add(name)
    return Evaluation(values=values, undefined=undefined, broken=frozenset(broken))


def _joined(each: Mapping[str, Evaluation]) -> Evaluation:
    """The metrics of several arms, by the arm, as one."""
    return Evaluation(
        values={f"{arm}_{name}": value for arm, e in each.items() for name, value in e.values.items()},
        undefined={f"{arm}_{name}": why for arm, e in each.items() for name, why in e.undefined.items()},
        broken=frozenset(f"{arm}_{name}" for arm, e in each.items() for name in e.broken),
    )


def of_one_arm(metrics: Mapping[str, float | None], arm: str) -> dict[str, float | None]:
    """The metrics of one of several arms, by the metrics' own names."""
    first = f"{arm}_"
    return {name.removeprefix(first): v for name, v in metrics.items() if name.startswith(first)}


def compute_metrics(trace: Trace) -> dict[str, float | None]:
    """Every metric of `trace`; None where it is not defined or could not be computed."""
    return dict(evaluate(trace).values)


def _reason(error: Exception) -> str:
    """What an error says, on one line; one that is no `Undefined` is named, since it is a bug."""
    said = " ".join(str(error).split())[:_LONGEST_REASON]
    return said if isinstance(error, Undefined) else f"{type(error).__name__}: {said}"


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
