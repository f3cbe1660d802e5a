"""How a run went: whether its task was done, and what it is held against.

The outcome says how a run ended; the verdict says what it was worth. A run that completed may have left its
task undone, and one that did its task may have torn at the incision.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from surgsim.errors import Outcome
from surgsim.metrics.catalog import of_one_arm
from surgsim.scenario.thresholds import Threshold, ThresholdsConfig
from surgsim.tasks import TASKS
from surgsim.tasks.success import Success, path_success
from surgsim.trace.trace import Trace

ALWAYS = ("rcm_error_max_mm", "trocar_force_max_n")
"""Thresholds that hold for every task; a task names those that it needs beside them."""
AT_LIMIT_RAD = 0.01
"""A joint nearer to the end of its range than this is said to be at its limit."""
Metrics = Mapping[str, float | None]


@dataclass(frozen=True, kw_only=True)
class Held:
    """A metric held against its threshold.

    Attributes:
        metric: Its name.
        value: What the run has.
        most: Largest value that passes.
        source: Where that comes from.
    """

    metric: str
    value: float
    most: float
    source: str

    @property
    def exceeded(self) -> bool:
        """Whether the value is past the threshold."""
        return not self.value <= self.most

    def __str__(self) -> str:
        """For a person, e.g. `rcm_error_max_mm 12.6 exceeds 5, docs/safety.md`."""
        return (
            f"{self.metric} {self.figure} {'exceeds' if self.exceeded else 'of'} {self.most:g}, {self.source}"
        )

    @property
    def figure(self) -> str:
        """The value with as many digits as tell it from the threshold, at least three."""
        texts = (f"{self.value:.{digits}g}" for digits in range(3, 17))
        same = (text for text in texts if (not float(text) <= self.most) == self.exceeded)
        return next(same, repr(self.value))


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """How a run went.

    Attributes:
        success: Whether the task was done; None where that is not defined.
        reason: Why.
        thresholds: What the run was held against.
    """

    success: bool | None
    reason: str
    thresholds: tuple[Held, ...] = ()

    @property
    def exceeded(self) -> tuple[Held, ...]:
        """The thresholds that were exceeded."""
        return tuple(held for held in self.thresholds if held.exceeded)

    def line(self) -> str:
        """The verdict on one line, for a person."""
        past = [str(held) for held in self.exceeded]
        if self.success and past:
            return f"Done, but {'; '.join(past)} ({self.reason})."
        head = {True: "Done", False: "NOT done", None: "Whether it was done is not defined"}[self.success]
        texts = [self.reason, *(text for text in past if not self.reason.startswith(text))]
        if not past and self.thresholds:
            texts.append(_within(self.thresholds))
        return f"{head}: {'; '.join(texts)}."

    def to_dict(self) -> dict[str, Any]:
        """Plain data: what `metrics.json` holds of it."""
        held = [{**asdict(each), "exceeded": each.exceeded} for each in self.thresholds]
        return {"success": self.success, "success_reason": self.reason, "thresholds": held}


def _within(thresholds: Iterable[Held]) -> str:
    """Thresholds that were kept, by their source: `within tip_error_max_mm 0.08 of 3, docs/safety.md`."""
    by_source: dict[str, list[str]] = {}
    for held in thresholds:
        text = f"{held.metric} {held.figure} of {held.most:g}"
        by_source.setdefault(held.source, []).append(text)
    return "within " + "; ".join(f"{', '.join(texts)}, {source}" for source, texts in by_source.items())


def unfinished(outcome: str) -> Verdict:
    """The verdict on a run that ended in `outcome` without a trace, e.g. `crashed`."""
    return Verdict(success=False, reason=f"the run ended as {outcome}")


def judge(trace: Trace, metrics: Metrics) -> Verdict:
    """The verdict on a run: a function of its trace, with its metrics at hand. It never raises.

    Several arms have done their task when each has.
    """
    if trace.arms:
        return _joined(judge_each(trace, metrics))
    scenario, ending = trace.meta.scenario, trace.meta.ending
    try:
        thresholds = ThresholdsConfig.model_validate_json(json.dumps(scenario.get("thresholds", {})))
        completed = ending.outcome is Outcome.COMPLETED
        found = _success(scenario["task"], trace.active()) if completed else _stopped(ending.outcome)
        at_limits = _at_limits(trace) if completed else ""
    except Exception as error:  # a task's mistake must not cost a finished run
        reason = f"it could not be judged, {type(error).__name__}: {' '.join(str(error).split())}"
        return Verdict(success=None, reason=reason[:300])
    held = _held(thresholds, metrics, (*found.needs, *ALWAYS))
    success, reason = _with_needs(found, held)
    return Verdict(success=success, reason=reason + at_limits, thresholds=held)


def judge_each(trace: Trace, metrics: Metrics) -> dict[str, Verdict]:
    """The verdict on each of several arms, by its name; none where there is one arm."""
    return {arm: judge(trace.of(arm), of_one_arm(metrics, arm)) for arm in trace.arms}


def _joined(each: Mapping[str, Verdict]) -> Verdict:
    """The verdict on all arms."""
    found = [verdict.success for verdict in each.values()]
    success = False if False in found else None if None in found else True
    return Verdict(
        success=success,
        reason=", ".join(f"{arm}: {verdict.reason}" for arm, verdict in each.items()),
        thresholds=tuple(
            replace(held, metric=f"{arm}_{held.metric}") for arm, v in each.items() for held in v.thresholds
        ),
    )


def _at_limits(trace: Trace) -> str:
    """Which joints were at their limit in the run, in words: tip or shaft may have been given up for them."""
    limits, q = trace.meta.limits, trace.active().block("q")
    room = np.minimum(q - np.array(limits["q_min"]), np.array(limits["q_max"]) - q).min(axis=0)
    at = [f"joint {i + 1}" for i in np.flatnonzero(room < AT_LIMIT_RAD)]
    return f", {' and '.join(at)} at {'its' if len(at) == 1 else 'their'} limit" if at else ""


def _stopped(outcome: Outcome) -> Success:
    """A run that did not come to its end has not done its task."""
    return Success(done=False, reason=f"the run ended as {outcome.name.lower()}")


def _success(task: Mapping[str, Any], run: Trace) -> Success:
    """What the task's config says of the run; a task that says nothing is taken for a path."""
    config = TASKS.config(str(task["type"])).model_validate_json(json.dumps(task))
    success: Success = getattr(config, "success", path_success)(run)
    return success


def _held(thresholds: ThresholdsConfig, metrics: Metrics, names: tuple[str, ...]) -> tuple[Held, ...]:
    """Those of the named thresholds that are set, and whose metric the run defines."""
    found = []
    for name in names:
        threshold: Threshold | None = getattr(thresholds, name, None)
        value = metrics.get(name)
        if threshold is not None and value is not None:
            found.append(Held(metric=name, value=value, most=threshold.most, source=threshold.source))
    return tuple(found)


def _with_needs(found: Success, held: tuple[Held, ...]) -> tuple[bool | None, str]:
    """Whether the task was done, and why, with the thresholds that it needs."""
    if not found.done or not found.needs:
        return found.done, found.reason
    needed = [each for each in held if each.metric in found.needs]
    if not needed:
        return None, f"no threshold is set for {' or '.join(found.needs)}"
    past = [str(each) for each in needed if each.exceeded]
    return (False, past[0]) if past else (True, found.reason)
