"""What the report is about: the table of a batch and what is written about it."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from surgsim.compare.columns import Table
from surgsim.compare.observations import Observations
from surgsim.compare.table import read_table
from surgsim.compare.unfinished import CSV
from surgsim.errors import SurgsimError
from surgsim.metrics.catalog import METRICS
from surgsim.recording.sealed import read_sealed

_HEADLINE = (
    "rcm_error_rms_mm",
    "tip_error_rms_mm",
    "manipulability_mean",
    "trocar_force_max_n",
    "velocity_error_rms_mm_per_s",
)
_SHOWN = (
    "rcm_error_rms_mm",
    "rcm_error_max_mm",
    "tip_error_rms_mm",
    "tip_error_max_mm",
    "manipulability_mean",
    "manipulability_min",
    "manipulability_optimality",
    "trocar_force_max_n",
    "velocity_error_rms_mm_per_s",
)


@dataclass(frozen=True, kw_only=True)
class Results:
    """A batch.

    Attributes:
        folder: Its results folder.
        rows: The table, a mapping for each run.
        runs: The same as arrays.
        suite: What `suite.json` says; empty without one.
    """

    folder: Path
    rows: Sequence[Mapping[str, Any]]
    runs: Observations
    suite: Mapping[str, Any]

    @property
    def name(self) -> str:
        """What the batch is called."""
        return str(self.suite.get("name") or self.folder.resolve().name)

    @cached_property
    def metrics(self) -> list[str]:
        """Metrics that any completed run has."""
        return [name for name in METRICS if np.isfinite(self.runs.values(name)).any()]

    @cached_property
    def headline(self) -> list[str]:
        """Metrics that are ranked and compared in pairs."""
        return [name for name in _HEADLINE if name in self.metrics] or self.metrics[:1]

    @cached_property
    def shown(self) -> list[str]:
        """Metrics drawn for each scenario without unfolding."""
        return [name for name in _SHOWN if name in self.metrics]


def read_results(folder: Path, matters: Mapping[str, float] | None = None) -> Results:
    """Read the results folder of a batch.

    Args:
        folder: The folder.
        matters: Smallest differences that matter, by metric, instead of the suite's.

    Raises:
        SurgsimError: If there is no table, it is damaged or empty, or `suite.json` cannot be read.
    """
    if not folder.is_dir():
        raise SurgsimError(f"{folder} is not a folder; give the one that `surgsim compare` wrote")
    return results_of(folder, read_table(folder), matters)


def results_of(folder: Path, table: Table, matters: Mapping[str, float] | None = None) -> Results:
    """As `read_results`, where the folder's `table` is at hand, as `read_table` gives it.

    Raises:
        SurgsimError: If it is not one of batch results, or `suite.json` cannot be read.
    """
    suite = _suite(folder / "suite.json")
    told = suite.get("matters")
    smallest = {**(told if isinstance(told, Mapping) else {}), **(matters or {})}
    try:
        runs = Observations.of(table, smallest)
    except SurgsimError as error:
        raise SurgsimError(f"{folder / CSV}: {error}") from error
    return Results(folder=folder, rows=table.rows(), runs=runs, suite=suite)


def _suite(path: Path) -> Mapping[str, Any]:
    if not path.is_file():
        return {}
    try:
        return read_sealed(path)
    except (OSError, ValueError) as error:
        raise SurgsimError(f"{path} is damaged: {error}") from error


def parameters_of(text: str) -> dict[str, Any]:
    """A run's point of the grid; empty if it cannot be read."""
    try:
        found = json.loads(text)
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}
