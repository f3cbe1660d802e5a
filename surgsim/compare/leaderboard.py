"""The leaderboard: a row for each controller, failures beside every figure."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from surgsim.compare.aggregates import iqm_interval, mean_rank, ranks, scores
from surgsim.compare.columns import Table
from surgsim.compare.failures import counted_outcomes
from surgsim.compare.intervals import Interval
from surgsim.compare.observations import COMPLETED, Observations, metric_named
from surgsim.compare.ranking import places_of

_RESAMPLES = 1000


@dataclass(frozen=True, kw_only=True)
class LeaderboardRow:
    """A controller in the leaderboard of one metric.

    Attributes:
        controller: Its name.
        runs: Its runs.
        completed: Those that ran to their end.
        failed: Those that did not.
        failures: Failed runs by outcome.
        not_done: Completed runs that did not do their task.
        undefined: Completed runs for which the metric is not defined.
        value: Interquartile mean of the metric over completed runs, in its unit.
        score: Interquartile mean of the normalised score: 1 is the best controller of each setting.
        rank: Mean rank over scenarios, failures last.
        place: One, plus the controllers that fail less or are better; None where places were not asked for.
    """

    controller: str
    runs: int
    completed: int
    failed: int
    failures: Mapping[str, int]
    not_done: int
    undefined: int
    value: Interval
    score: Interval
    rank: Interval
    place: int | None = None

    @property
    def failed_words(self) -> str:
        """Failures by outcome, and completed runs that did not do their task; `none` without any."""
        undone = f"{self.not_done} not done" if self.not_done else ""
        return ", ".join(filter(None, (counted_outcomes(self.failures), undone))) or "none"


def leaderboard(table: Table | Observations, metric: str, *, places: bool = True) -> list[LeaderboardRow]:
    """Rows for `metric`, the best place first, then the best mean rank.

    Args:
        table: The batch.
        metric: Name of the metric.
        places: Whether to compare the controllers in pairs for their places, which takes a while.

    Raises:
        SurgsimError: If the metric is unknown, or the table is not one of batch results.
    """
    metric_named(metric)
    runs = table if isinstance(table, Observations) else Observations.of(table)
    score, rank = scores(runs, metric), ranks(runs, metric)
    place = places_of(runs, metric) if places else {}
    rows = [_row(runs, name, metric, score, rank, place.get(name)) for name in runs.controllers]
    return sorted(rows, key=_order)


def _row(
    everyone: Observations,
    name: str,
    metric: str,
    score: np.ndarray,
    rank: np.ndarray,
    place: int | None,
) -> LeaderboardRow:
    mine = np.asarray(everyone.controller == name, dtype=bool)
    runs = everyone.where(mine)
    values, completed = runs.values(metric), int(runs.completed.sum())
    identity = f"{metric} {name}"
    return LeaderboardRow(
        controller=name,
        runs=len(runs),
        completed=completed,
        failed=len(runs) - completed,
        failures=dict(Counter(outcome for outcome in runs.outcome.tolist() if outcome != COMPLETED)),
        not_done=int(runs.not_done.sum()),
        undefined=completed - int(np.isfinite(values).sum()),
        value=iqm_interval(runs, values, identity, _RESAMPLES),
        score=iqm_interval(runs, score[mine], f"{identity} score", _RESAMPLES),
        rank=mean_rank(runs, rank[mine], identity, _RESAMPLES),
        place=place,
    )


def _order(row: LeaderboardRow) -> tuple[float, float, float, str]:
    """Best place first, then the best mean rank, then the best score; what has neither comes last."""
    keys = [np.inf if figure.value is None else figure.value for figure in (row.rank, row.score)]
    return (row.place or 0, keys[0], keys[1], row.controller)
