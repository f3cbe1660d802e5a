"""The results of a batch, as Python sees them."""

import os
import shutil
import weakref
from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np

from surgsim.api.leaderboard import Leaderboard
from surgsim.api.run import Run, read_run
from surgsim.array import Array
from surgsim.compare.columns import Table
from surgsim.compare.leaderboard import leaderboard
from surgsim.compare.observations import Observations
from surgsim.compare.summary import summary
from surgsim.compare.table import read_table, schema
from surgsim.display import WIDTH, count, html_table, html_title, number, text_table
from surgsim.errors import not_held
from surgsim.report.results import Results, results_of
from surgsim.report.write import write_page

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

_SHOWN = {"tip_error_rms_mm": "tip error", "rcm_error_rms_mm": "RCM error"}
"""Metrics of the short table, with their headings: medians of the root mean squares [mm]."""
_HEADER = ("controller", "runs", "completed", "not done", *_SHOWN.values())
_RIGHT = (1, 2, 3, 4, 5)
_NOTE = (
    "Not done: completed, but the task was not done.\n"
    "Errors: medians over completed runs of the root mean square over time [mm]."
)


class _Keeper:
    """Removes a folder when nobody holds it any more."""

    def __init__(self, folder: Path) -> None:
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)


class Comparison(Mapping[str, Run]):
    """Runs of several scenarios, controllers and seeds: a mapping of their ids to them.

    `surgsim.compare` makes one, `surgsim.read` reads one.

    Args:
        folder: The results folder.
        table: One row per run.
        temporary: Whether the folder is removed once nobody holds this object or a run of it.

    Example:
        >>> import surgsim
        >>> found = surgsim.compare("circle_lwr4plus", controllers=["pinv", "qp"], task={"duration_s": 2.0})
        >>> list(found)
        ['circle_lwr4plus/pinv/base-seed0', 'circle_lwr4plus/qp/base-seed0']
        >>> found["circle_lwr4plus/qp/base-seed0"].outcome
        'completed'
        >>> found.table["controller"]
        ('pinv', 'qp')
        >>> len(found.leaderboard("tip_error_rms_mm"))
        2
    """

    def __init__(self, folder: Path, table: Table, *, temporary: bool = False) -> None:
        self.folder = folder
        self.table = table
        self._keeper = _Keeper(folder) if temporary else None

    @staticmethod
    def of_folder(folder: str | os.PathLike[str]) -> "Comparison":
        """The batch in a results folder.

        Raises:
            SurgsimError: If it is not finished, or damaged.
        """
        place = Path(folder)
        return Comparison(place, read_table(place))

    def __getitem__(self, run_id: str) -> Run:
        if run_id not in self._folders:
            raise not_held(run_id, "run of this batch", self._folders, "list(comparison)")
        found = read_run(self.folder / self._folders[run_id], self._keeper)
        return found.arms[run_id.rpartition(".")[2]] if found.arms else found

    def __iter__(self) -> Iterator[str]:
        return iter(self._folders)

    def __len__(self) -> int:
        return len(self._folders)

    @cached_property
    def _folders(self) -> dict[str, str]:
        pairs = zip(self.table["run_id"], self.table["folder"], strict=True)
        return {str(run_id): str(folder) for run_id, folder in pairs}

    @cached_property
    def _results(self) -> Results:
        return results_of(self.folder, self.table)

    @property
    def _runs(self) -> Observations:
        return self._results.runs

    @property
    def controllers(self) -> list[str]:
        """Names of the controllers."""
        return self._runs.controllers

    @property
    def scenarios(self) -> list[str]:
        """Names of the scenarios."""
        return self._runs.scenarios

    def to_pandas(self) -> "pd.DataFrame":
        """The table as a data frame, one row per run, failed ones included.

        Raises:
            SurgsimError: If pandas is not installed.
        """
        return self.table.to_pandas(schema())

    def to_arrow(self) -> "pa.Table":
        """The table as one of pyarrow, null where a run has nothing.

        Raises:
            SurgsimError: If pyarrow is not installed.
        """
        return self.table.to_arrow(schema())

    def leaderboard(self, metric: str = "rcm_error_rms_mm") -> Leaderboard:
        """Controllers by one metric, the best mean rank first, with intervals and failures.

        Raises:
            SurgsimError: If there is no such metric.
        """
        rows = leaderboard(self._runs, metric)
        return Leaderboard(metric, rows, summary(self._runs, metric, rows).first)

    def report(self, path: str | os.PathLike[str] | None = None) -> Path:
        """Write the page about the batch and return where it is.

        Args:
            path: File to write; None: `report.html` in the results folder.

        Raises:
            SurgsimError: If the disk refuses.
        """
        return write_page(self._results, path)

    def __repr__(self) -> str:
        said = fill(self.leaderboard().sentence, WIDTH, break_long_words=False)
        return f"{self._title}\n{said}\n\n{text_table(_HEADER, self._summary(), _RIGHT)}\n{_NOTE}"

    def _repr_html_(self) -> str:
        return html_title(self._title, self.leaderboard().sentence, _NOTE) + html_table(
            _HEADER, self._summary(), _RIGHT
        )

    @property
    def _title(self) -> str:
        parts = (
            count(len(self), "run"),
            count(len(self.scenarios), "scenario"),
            count(len(self.controllers), "controller"),
            count(len(set(self._runs.seed.tolist())), "seed"),
        )
        return f"Comparison of {', '.join(parts)}"

    def _summary(self) -> list[tuple[str, ...]]:
        """A row for each controller."""
        rows = []
        for name in self.controllers:
            runs = self._runs.of_controller(name)
            medians = [_median(runs.values(metric)) for metric in _SHOWN]
            counts = (len(runs), int(runs.completed.sum()), int(runs.not_done.sum()))
            rows.append((name, *map(str, counts), *map(number, medians)))
        return rows


def _median(values: Array) -> float | None:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if finite.size else None
