"""Errors over time, read from the recordings of a batch: a few runs each, thinned."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from surgsim.array import Array
from surgsim.compare.observations import COMPLETED
from surgsim.errors import SurgsimError
from surgsim.recording.read import read_recording
from surgsim.resources import cores
from surgsim.trace.trace import Trace

SLICES = 160
MOST_RUNS = 8
MOST_RECORDINGS = 80
COLUMNS = {
    "rcm_error_m": ("RCM error [mm]", 1e3),
    "tip_error_m": ("tip error [mm]", 1e3),
    "manipulability": ("manipulability", 1.0),
}
"""Columns that are drawn, with their label and the factor to the unit in it."""


@dataclass(frozen=True, kw_only=True)
class Series:
    """Recorded runs of one scenario at one grid point.

    Attributes:
        parameters: The grid point, as in the table.
        time_s: Middle of each slice (SLICES,).
        completed: By controller and column, completed runs (runs, SLICES).
        failed: The same of failed runs, NaN after their end.
        unreadable: Recordings that could not be read.
    """

    parameters: str
    time_s: Array
    completed: Mapping[str, Mapping[str, Array]]
    failed: Mapping[str, Mapping[str, Array]]
    unreadable: int


def read_series(
    root: Path, rows: Sequence[Mapping[str, Any]], scenarios: Sequence[str], say: Callable[[str], None]
) -> dict[str, Series]:
    """Series of each scenario that has recordings.

    Args:
        root: The results folder.
        rows: The table.
        scenarios: Names.
        say: Told what is being read, because it takes about a second a recording.
    """
    chosen = {name: _choose(root, [row for row in rows if row["scenario"] == name]) for name in scenarios}
    count = sum(len(runs) for runs in chosen.values())
    if not count:
        return {}
    most = max(1, MOST_RUNS * MOST_RECORDINGS // max(count, MOST_RECORDINGS))
    chosen = {name: _first_of_each(runs, most) for name, runs in chosen.items() if runs}
    say(f"reading {sum(len(runs) for runs in chosen.values())} recordings for the figures over time")
    found = {name: _series(root, runs) for name, runs in chosen.items()}
    if lost := sum(series.unreadable for series in found.values()):
        say(f"{lost} recordings could not be read: the figures over time leave them out")
    return found


def _choose(root: Path, rows: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Recorded runs at the grid point with the most controllers; the first such point."""
    points: dict[str, list[Mapping[str, Any]]] = {}
    for row in rows:
        if row["recording"] and (root / row["recording"]).is_file():
            points.setdefault(row["parameters"], []).append(row)
    if not points:
        return []
    best = max(points.values(), key=lambda runs: len({run["controller"] for run in runs}))
    return _first_of_each(best, MOST_RUNS)


def _first_of_each(rows: Sequence[Mapping[str, Any]], most: int) -> list[Mapping[str, Any]]:
    """The first `most` runs of each controller."""
    kept: dict[str, list[Mapping[str, Any]]] = {}
    for row in rows:
        mine = kept.setdefault(row["controller"], [])
        if len(mine) < most:
            mine.append(row)
    return [row for mine in kept.values() for row in mine]


def _series(root: Path, rows: Sequence[Mapping[str, Any]]) -> Series:
    with ThreadPoolExecutor(max_workers=min(4, cores())) as pool:
        traces = list(pool.map(lambda row: _trace(root / row["recording"], row["scenario"]), rows))
    pairs = [(row, trace) for row, trace in zip(rows, traces, strict=True) if trace is not None]
    end = max((float(trace["t_s"][-1]) for _, trace in pairs), default=1.0)
    kinds: dict[bool, dict[str, dict[str, list[Array]]]] = {True: {}, False: {}}
    for row, trace in pairs:
        mine = kinds[row["outcome"] == COMPLETED].setdefault(row["controller"], {})
        for column, (_, factor) in COLUMNS.items():
            mine.setdefault(column, []).append(factor * thin(trace, column, end))
    completed, failed = (
        {
            name: {column: np.array(runs) for column, runs in mine.items()}
            for name, mine in kinds[done].items()
        }
        for done in (True, False)
    )
    return Series(
        parameters=rows[0]["parameters"],
        time_s=(np.arange(SLICES) + 0.5) * end / SLICES,
        completed=completed,
        failed=failed,
        unreadable=len(rows) - len(pairs),
    )


def _trace(path: Path, scenario: str) -> Trace | None:
    """What is recorded there, of several arms that one which ends the scenario's name."""
    try:
        trace = read_recording(path).trace.active()
        return trace.of(scenario.rpartition(".")[2]) if trace.arms else trace
    except SurgsimError:
        return None


def thin(trace: Trace, column: str, end_s: float) -> Array:
    """Worst value of each slice of time (SLICES,), the largest, of a manipulability the smallest."""
    values, time_s = trace[column], trace["t_s"]
    slices = np.minimum((time_s / max(end_s, 1e-9) * SLICES).astype(int), SLICES - 1)
    worst = np.fmin if column == "manipulability" else np.fmax
    found = np.full(SLICES, np.nan)
    worst.at(found, slices, values)
    return found
