"""Where a controller fails along a sweep: the first level at which it does not do its task."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from surgsim.compare.failures import WORST_RCM_MM, outcome_words
from surgsim.compare.observations import COMPLETED, Observations
from surgsim.report.axes import Axis
from surgsim.report.results import parameters_of


@dataclass(frozen=True, kw_only=True)
class AtLevel:
    """Runs of one controller at one level.

    Attributes:
        runs: All of them.
        failed: Those that did not complete.
        outcomes: How those ended, each way once.
        rcm_max_mm: Largest RCM error of the completed ones [mm]; NaN without any.
    """

    runs: int
    failed: int
    outcomes: str
    rcm_max_mm: float

    @property
    def mark(self) -> str:
        """What failed in a few characters; empty if nothing did."""
        if self.failed:
            return f"{self.failed}/{self.runs}"
        return f">{WORST_RCM_MM:g} mm" if self.rcm_max_mm > WORST_RCM_MM else ""

    @property
    def sentence(self) -> str:
        """The same in words."""
        if self.failed:
            return f"{self.failed} of {self.runs} failed: {self.outcomes}"
        return f"RCM error up to {self.rcm_max_mm:.3g} mm" if self.mark else ""


def at_level(runs: Observations) -> AtLevel:
    """What became of `runs`."""
    ends: dict[str, int] = {}
    for outcome in runs.outcome.tolist():
        if outcome != COMPLETED:
            ends[outcome] = ends.get(outcome, 0) + 1
    errors = runs.values("rcm_error_max_mm")
    return AtLevel(
        runs=len(runs),
        failed=sum(ends.values()),
        outcomes=", ".join(map(outcome_words, ends)),
        rcm_max_mm=float(np.nanmax(errors)) if np.isfinite(errors).any() else float("nan"),
    )


def along(runs: Observations, axis: Axis, sweeps: Sequence[Axis]) -> list[Observations]:
    """Runs with none of the `sweeps`, then those at each level of `axis`."""
    points = [parameters_of(text) for text in runs.parameters.tolist()]
    swept = [{sweep.name for sweep in sweeps} & set(point) for point in points]
    masks = [np.array([not names for names in swept], dtype=bool)]
    for level in axis.levels:
        masks.append(np.array([point.get(axis.name) == level for point in points], dtype=bool))
    return [runs.where(mask) for mask in masks]
