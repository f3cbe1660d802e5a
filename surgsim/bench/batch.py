"""Runs per second of a batch with one worker and with two, measured in turn.

Wall time of a loaded machine says little: the CPU time of a run stands beside it, and how many runs as many
workers would end in a second if each had a core for itself. That CPU time holds a share of starting the
workers, which two pay twice.
"""

import os
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

from surgsim.bench.cases import CIRCLE
from surgsim.compare.engine import Batch, compare
from surgsim.compare.suite import SuiteConfig
from surgsim.errors import SurgsimError

Row = dict[str, Any]

WORKERS = (1, 2)


def measure_batch(runs: int, duration_s: float, repeat: int) -> list[Row]:
    """A row for each of `WORKERS`.

    Args:
        runs: Runs of a batch.
        duration_s: Simulated time of a run, besides its holds [s].
        repeat: Batches of each; the median counts.
    """
    found = [[_Measured(runs, duration_s, count) for count in WORKERS] for _ in range(repeat)]
    rows = []
    for workers, batches in zip(WORKERS, zip(*found, strict=True), strict=True):
        cpu_s = statistics.median(batch.cpu_s for batch in batches)
        rows.append(
            {
                "workers": workers,
                "runs_per_s": statistics.median(batch.runs_per_s for batch in batches),
                "cpu_s_per_run": cpu_s,
                "runs_per_s_with_a_core_each": None if cpu_s == 0.0 else workers / cpu_s,
            }
        )
    return rows


class _Measured:
    """One batch, from the moment at which every worker has answered: starting them is left out."""

    def __init__(self, runs: int, duration_s: float, workers: int) -> None:
        self._workers = workers
        self._began_s = self._ended_s = 0.0
        before = _children_cpu_s()
        with tempfile.TemporaryDirectory(prefix="surgsim-bench-") as folder:
            batch = Batch(
                suite=_suite(runs, duration_s), folder=Path(), out=Path(folder) / "out", jobs=workers
            )
            table = compare(batch, self._report)
        if table is None or set(table["outcome"]) != {"completed"}:
            raise SurgsimError("bench: a run of the batch did not complete")
        self.runs_per_s = (runs - workers) / (self._ended_s - self._began_s)
        self.cpu_s = (_children_cpu_s() - before) / runs

    def _report(self, done: int, count: int, outcome: str) -> None:
        self._ended_s = time.perf_counter()
        if done == self._workers:
            self._began_s = self._ended_s


def _suite(runs: int, duration_s: float) -> SuiteConfig:
    return SuiteConfig(
        name="bench",
        scenarios=(CIRCLE,),
        controllers=("pinv",),
        seeds=f"0:{runs}",
        settings=(
            f"task.duration_s={duration_s}",
            "task.hold_start_s=0",
            "task.hold_end_s=0",
            "disturbances=[{type: payload, spread: 0.5}]",
        ),
    )


def _children_cpu_s() -> float:
    """CPU time of the processes that have ended."""
    used = os.times()
    return used.children_user + used.children_system
