"""What every metric promises."""

import math
from functools import lru_cache

from surgsim.contract.check import Check, require
from surgsim.metrics.metric import Metric, Undefined
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import simulate
from surgsim.trace.trace import Trace

_SHORT = ("task.duration_s=2.0", "task.hold_end_s=0.0", "theatre=false")
_SHORTEST, _LONGEST = 10, 160


@lru_cache(maxsize=2)
def _traces() -> tuple[Trace, Trace]:
    """A run with a port, and one without."""
    through = load_scenario("circle_lwr4plus", controller="pinv", assignments=_SHORT)
    content = through.resolved()
    resolver = {**content["controller"]["resolver"], "rcm": False}
    controller = {**content["controller"], "resolver": resolver}
    free = load_scenario({**content, "trocar": None, "controller": controller})
    return simulate(through), simulate(free)


def computes(metric: Metric) -> None:
    """A number, or none with a reason; the same again, of a run with a port and of one without."""
    for trace in _traces():
        seen = trace if metric.whole else trace.active()
        first, again = _value(metric, seen), _value(metric, seen)
        require(first == again, f"the same run gives {first}, then {again}")


def _value(metric: Metric, trace: Trace) -> float | None:
    try:
        value = metric.compute(trace)
    except Undefined:
        return None
    require(isinstance(value, float | int) or hasattr(value, "dtype"), f"{value!r} is no number")
    return None if math.isnan(value) else float(value)


def is_told(metric: Metric) -> None:
    """Heading and meaning are words: tables and `surgsim list metrics` show them."""
    require(0 < len(metric.heading) <= _LONGEST, "the heading is empty, or too long")
    length = len(metric.meaning)
    require(
        _SHORTEST <= length <= _LONGEST, f"the meaning has {length} letters, not {_SHORTEST} to {_LONGEST}"
    )
    require(metric.matters >= 0.0, f"the smallest difference that matters is {metric.matters:g}")
    require(metric.digits > 0, f"{metric.digits} digits are worth printing")


CHECKS = (
    Check(name="gives a number or none, and the same again", run=computes),
    Check(name="says what it is", run=is_told),
)
