"""The table of a batch as arrays: what the statistics work on."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surgsim.array import Array
from surgsim.compare.columns import Table
from surgsim.errors import Outcome, SurgsimError, unknown_name
from surgsim.metrics.catalog import METRICS
from surgsim.metrics.metric import Metric

Mask = NDArray[np.bool_]
Texts = NDArray[Any]

COMPLETED = Outcome.COMPLETED.name.lower()


@dataclass(frozen=True, kw_only=True)
class Observations:
    """Runs of a batch, one entry each.

    Attributes:
        scenario: Names (n,).
        controller: Names (n,).
        parameters: Points of the grid as JSON text (n,).
        seed: Seeds (n,).
        outcome: Names of the outcomes (n,).
        metrics: Values by metric's name (n,); NaN where a metric is not defined.
        success: Whether the task was done (n,), 1 or 0; NaN where the task does not say.
        exceeded: Metrics past their thresholds (n,), as text with commas.
        smallest: Smallest differences that matter, by metric, where others than the metrics' own are wanted.
    """

    scenario: Texts
    controller: Texts
    parameters: Texts
    seed: NDArray[np.int64]
    outcome: Texts
    metrics: Mapping[str, Array]
    success: Array
    exceeded: Texts
    smallest: Mapping[str, float] = field(default_factory=dict)

    @staticmethod
    def of(table: Table, smallest: Mapping[str, float] | None = None) -> "Observations":
        """Observations of a batch's table.

        Args:
            table: The table.
            smallest: Smallest differences that matter, by metric; the metrics' own for the others.

        Raises:
            SurgsimError: If a column is missing or not of its type.
        """
        try:
            texts = {
                name: _texts(table, name) for name in ("scenario", "controller", "parameters", "outcome")
            }
            seed = np.array(table["seed"], dtype=np.int64)
            metrics = {name: _numbers(table, name) for name in METRICS}
            success = _numbers(table, "success")
            exceeded = [text or "" for text in table["exceeded"]]
        except (KeyError, TypeError, ValueError) as error:
            raise SurgsimError(f"not a table of batch results: {error}") from error
        return Observations(
            **texts,
            seed=seed,
            metrics=metrics,
            success=success,
            exceeded=np.array(exceeded, dtype=object),
            smallest=dict(smallest or {}),
        )

    def __len__(self) -> int:
        return len(self.seed)

    @property
    def completed(self) -> Mask:
        """Whether a run ran to its end (n,)."""
        return np.asarray(self.outcome == COMPLETED, dtype=bool)

    @property
    def not_done(self) -> Mask:
        """Whether a run ran to its end, but did not do its task (n,)."""
        return np.asarray(self.completed & (self.success == 0.0), dtype=bool)

    @property
    def standing(self) -> NDArray[np.int64]:
        """What comes before any figure (n,): 2 where the task was done, 1 where not, 0 for a failure."""
        return np.asarray(2 * self.completed - 1 * self.not_done, dtype=np.int64)

    @property
    def controllers(self) -> list[str]:
        """Names of the controllers in order of appearance."""
        return list(dict.fromkeys(self.controller.tolist()))

    @property
    def scenarios(self) -> list[str]:
        """Names of the scenarios in order of appearance."""
        return list(dict.fromkeys(self.scenario.tolist()))

    def values(self, metric: str) -> Array:
        """Values of `metric` (n,); NaN for a run that did not complete."""
        return np.where(self.completed, self.metrics[metric], np.nan)

    def matters(self, metric: str) -> float:
        """Smallest difference of `metric` that matters, in its unit; 0 if any does."""
        return self.smallest.get(metric, metric_named(metric).matters)

    def where(self, mask: Mask) -> "Observations":
        """The runs of which `mask` is true."""
        return replace(
            self,
            scenario=self.scenario[mask],
            controller=self.controller[mask],
            parameters=self.parameters[mask],
            seed=self.seed[mask],
            outcome=self.outcome[mask],
            success=self.success[mask],
            exceeded=self.exceeded[mask],
            metrics={name: values[mask] for name, values in self.metrics.items()},
        )

    def of_controller(self, name: str) -> "Observations":
        """The runs of one controller."""
        return self.where(np.asarray(self.controller == name, dtype=bool))

    def of_scenario(self, name: str) -> "Observations":
        """The runs of one scenario."""
        return self.where(np.asarray(self.scenario == name, dtype=bool))


def metric_named(name: str) -> Metric:
    """The metric called `name`.

    Raises:
        SurgsimError: If there is none.
    """
    if name not in METRICS:
        raise SurgsimError(unknown_name(name, "metric", METRICS))
    return METRICS[name]


def _texts(table: Table, name: str) -> Texts:
    values = table[name]
    if not all(isinstance(value, str) for value in values):
        raise ValueError(f"column '{name}' holds something other than text")
    return np.array(values, dtype=object)


def _numbers(table: Table, name: str) -> Array:
    values = np.array(table[name], dtype=np.float64)  # None becomes NaN
    return np.where(np.isfinite(values), values, np.nan)
