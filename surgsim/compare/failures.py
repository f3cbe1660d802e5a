"""Where controllers fail: runs that did not complete, tasks not done, thresholds exceeded."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from surgsim.compare.figure_text import counted, heading_of, listed, with_unit
from surgsim.compare.observations import Mask, Observations
from surgsim.metrics.accuracy import CONVERGED_RCM_M
from surgsim.metrics.catalog import METRICS

WORST_RCM_MM = 1e3 * CONVERGED_RCM_M
"""Largest RCM error of a run that holds a level of a sweep [mm]; the convergence time's bound."""
_FAILED, _NOT_DONE = "failed", "not done"


@dataclass(frozen=True, kw_only=True)
class Failing:
    """Controllers that fail in the same respects.

    Attributes:
        controllers: Their names.
        text: Where they fail, or that they do not.
        bad: Whether they do.
    """

    controllers: tuple[str, ...]
    text: str
    bad: bool

    @property
    def sentence(self) -> str:
        """The same with the names in front."""
        return f"{listed(self.controllers, 12)}: {self.text}"


def failing(runs: Observations) -> list[Failing]:
    """Where each controller fails, failures first; those that fail in the same respects are together."""
    groups: dict[tuple[str, ...], dict[str, _Seen]] = {}
    for name in runs.controllers:
        mine = runs.of_controller(name)
        seen = _Seen(runs=mine, masks=_respects(mine))
        groups.setdefault(tuple(seen.masks), {})[name] = seen
    found = [
        Failing(controllers=tuple(group), text=_told(list(group.values()), respects), bad=bool(respects))
        for respects, group in groups.items()
    ]
    return sorted(found, key=lambda one: not one.bad)


@dataclass(frozen=True, kw_only=True)
class _Seen:
    """Runs of one controller, and for each respect in which some fail, which do."""

    runs: Observations
    masks: Mapping[str, Mask]


def outcome_words(name: str) -> str:
    """An outcome's name as words: `rcm limit`."""
    return name.replace("_", " ")


def counted_outcomes(counts: Mapping[str, int]) -> str:
    """`2 rcm limit, 1 diverged`, the most frequent first."""
    return counted({outcome_words(name): count for name, count in counts.items()})


def _respects(runs: Observations) -> dict[str, Mask]:
    """In what respects runs of one controller fail, and which do."""
    found = {_FAILED: ~runs.completed, _NOT_DONE: runs.not_done}
    for metric in METRICS:
        past = [metric in text.split(",") for text in runs.exceeded.tolist()]
        found[metric] = np.asarray(runs.completed & np.array(past, dtype=bool), dtype=bool)
    return {respect: mask for respect, mask in found.items() if mask.any()}


def _told(each: Sequence[_Seen], respects: Sequence[str]) -> str:
    """What is to be said of controllers that fail in these respects."""
    if not respects:
        done = " and did its task" if all(bool((one.runs.success == 1.0).all()) for one in each) else ""
        count = "every run" if any(len(one.runs) > 1 for one in each) else "the run"
        return f"nowhere, {count} completed{done}, and no threshold was exceeded"
    parts = [_unfinished(respect, each) for respect in respects if respect in (_FAILED, _NOT_DONE)]
    past: dict[str, list[str]] = {}
    for metric in respects:
        if metric not in (_FAILED, _NOT_DONE):
            past.setdefault(_share(metric, each), []).append(_worst(metric, each))
    parts += [f"past thresholds in {share}: {', '.join(worst)}" for share, worst in past.items()]
    return "; ".join(parts)


def _unfinished(respect: str, each: Sequence[_Seen]) -> str:
    """In how many runs the end was not reached, and how those ended; or the task was not done."""
    if respect == _NOT_DONE:
        return f"completed, task not done in {_share(respect, each)}"
    ends = Counter(outcome for one in each for outcome in one.runs.outcome[one.masks[_FAILED]].tolist())
    return f"failed in {_share(respect, each)} ({counted_outcomes(ends)})"


def _share(respect: str, each: Sequence[_Seen]) -> str:
    """In how many runs of each controller it fails in one respect, and in which scenarios."""
    completed = respect not in (_FAILED, _NOT_DONE)
    totals = {int(one.runs.completed.sum()) if completed else len(one.runs) for one in each}
    counts = sorted({int(one.masks[respect].sum()) for one in each})
    share = f"{counts[0]} to {counts[-1]}" if len(counts) > 1 else f"{counts[0]}"
    share += f" of {totals.pop()}" if len(totals) == 1 else ""
    return share + (" each" if len(each) > 1 else "") + _where(respect, each)


def _worst(metric: str, each: Sequence[_Seen]) -> str:
    """The metric and its largest value in completed runs."""
    words, unit = heading_of(METRICS[metric])
    worst = max(float(np.nanmax(one.runs.values(metric))) for one in each)
    return f"{words} (up to {with_unit(worst, unit)})"


def _where(respect: str, each: Sequence[_Seen]) -> str:
    """The scenarios of the runs that fail in one respect, unless they are all of them."""
    there = [name for one in each for name in one.runs.scenario[one.masks[respect]].tolist()]
    every = {name for one in each for name in one.runs.scenarios}
    found = list(dict.fromkeys(there))
    return "" if len(found) == len(every) else f", in {listed(found)}"
