"""Where controllers fail: runs that did not complete, tasks not done, shafts that left the port."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from surgsim.compare.observations import Observations
from surgsim.compare.wording import listed, number
from surgsim.metrics.accuracy import CONVERGED_RCM_M

WORST_RCM_MM = 1e3 * CONVERGED_RCM_M
"""Largest RCM error of a run that counts as done [mm]; the convergence time's bound of the shaft."""
_RCM = "rcm_error_max_mm"


@dataclass(frozen=True, kw_only=True)
class Failing:
    """Controllers of which the same is to be said.

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
    """Where each controller fails, failures first; controllers of which the same is true are together."""
    told: dict[str, list[str]] = {}
    for name in runs.controllers:
        told.setdefault(_told(runs.of_controller(name)), []).append(name)
    found = [_failing(runs, tuple(names), text) for text, names in told.items()]
    return sorted(found, key=lambda one: not one.bad)


def _failing(runs: Observations, names: tuple[str, ...], text: str) -> Failing:
    mine = runs.where(np.isin(runs.controller.astype(str), names))
    if not text:
        return Failing(controllers=names, text=_all_well(mine.of_controller(names[0])), bad=False)
    errors = mine.values(_RCM)
    worst = f", at worst {number(float(np.nanmax(errors)))} mm" if (errors > WORST_RCM_MM).any() else ""
    return Failing(controllers=names, text=text + worst, bad=True)


def outcome_words(name: str) -> str:
    """An outcome's name as words: `rcm limit`."""
    return name.replace("_", " ")


def counted_outcomes(counts: Mapping[str, int]) -> str:
    """`2 rcm limit, 1 diverged`, the most frequent first."""
    items = sorted(counts.items(), key=lambda item: (-item[1], item[0]))
    return ", ".join(f"{count} {outcome_words(name)}" for name, count in items if count)


def _told(runs: Observations) -> str:
    """What is wrong with one controller's runs; empty if nothing is."""
    failed, past = ~runs.completed, runs.values(_RCM) > WORST_RCM_MM
    parts = []
    if failed.any():
        how = counted_outcomes(Counter(runs.outcome[failed].tolist()))
        parts.append(f"{int(failed.sum())} of {len(runs)} runs failed ({how}{_where(runs, failed)})")
    if runs.not_done.any():
        count = f"{int(runs.not_done.sum())} of {len(runs)} runs"
        parts.append(f"{count} completed, task not done{_where(runs, runs.not_done)}")
    if past.any():
        count = f"{int(past.sum())} of {int(runs.completed.sum())} completed runs"
        parts.append(f"RCM error past {WORST_RCM_MM:g} mm in {count}{_where(runs, past)}")
    return "; ".join(parts)


def _all_well(runs: Observations) -> str:
    kept = np.isfinite(runs.values(_RCM)).all()
    shaft = f" with an RCM error of at most {WORST_RCM_MM:g} mm" if kept else ""
    count = f"all {len(runs)} runs" if len(runs) > 1 else "its one run"
    return f"nowhere, {count} completed{shaft}"


def _where(runs: Observations, mask: np.ndarray) -> str:
    """The scenarios of some runs, unless they are all of them or there is only one."""
    there = list(dict.fromkeys(runs.scenario[mask].tolist()))
    return "" if len(there) == len(runs.scenarios) else f", in {listed(there)}"
