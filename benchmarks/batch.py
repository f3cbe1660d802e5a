"""What the batch engine adds to the simulations: time per run, memory of the driver, gain of a second worker.

    python benchmarks/batch.py                 1000 short runs, then one worker against two
    python benchmarks/batch.py --runs 100      fewer

Starting the processes (about 2 s each, at the same time) is left out: the clock starts when every worker has
answered once. Wall time means something on a quiet machine only; CPU time beside it means something on any.
"""

import argparse
import os
import resource
import shutil
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from surgsim.cli.table import print_table
from surgsim.compare.engine import Batch, compare
from surgsim.compare.job import Job
from surgsim.compare.suite import SuiteConfig, check_runs, expand
from surgsim.compare.workers import Done, run_jobs
from surgsim.metrics.catalog import METRICS
from surgsim.runs.folder import RunResult, write_run
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import prepare

SHORT = (
    "theatre=false",
    "task.ramp_s=0.1",
    "task.hold_start_s=0",
    "task.hold_end_s=0",
    "task.radius_m=0.002",
)


def suite(runs: int, duration_s: float) -> SuiteConfig:
    disturbance = "disturbances=[{type: payload, spread: 0.5}]"
    return SuiteConfig(
        name="short",
        scenarios=("circle_lwr4plus",),
        controllers=("pinv",),
        seeds=f"0:{runs}",
        settings=(*SHORT, f"task.duration_s={duration_s}", disturbance),
    )


def parts_ms(runs: int, folder: Path) -> list[tuple[str, float]]:
    """Median CPU time of each part of a run, in this process [ms]."""
    times: dict[str, list[float]] = {}

    def timed(name: str, call: Callable[[], object]) -> object:
        began = time.process_time()
        result = call()
        times.setdefault(name, []).append(1e3 * (time.process_time() - began))
        return result

    for i, scenario in enumerate(check_runs(expand(suite(runs, 0.2), Path()))):
        setup = timed("simulation: building the models", lambda s=scenario: prepare(s))
        trace = timed("simulation: its ticks", lambda s=setup: Simulation(s).run())
        values = {
            name: timed(
                name if name == "manipulability_optimality" else "other metrics",
                lambda m=metric, t=trace: m.compute(t),
            )
            for name, metric in METRICS.items()
        }
        result = RunResult(trace=trace, metrics=values, wall_time_s=0.0)
        target = folder / str(i)
        timed("its folder", lambda s=scenario, r=result, f=target: write_run(s, r, f, record=False))
    others = times.pop("other metrics")
    medians = {name: statistics.median(found) for name, found in times.items()}
    medians["other metrics"] = statistics.mean(others) * (len(METRICS) - 1)
    return list(medians.items())


class Measured:
    """A batch, measured."""

    def __init__(self, runs: int, duration_s: float, workers: int) -> None:
        self._runs, self._workers = runs, workers
        self.memory_mb: list[float] = []
        out = Path(tempfile.mkdtemp(prefix="surgsim-benchmark-"))
        try:
            began, cpu, own = time.perf_counter(), _children_cpu_s(), time.process_time()
            batch = Batch(suite=suite(runs, duration_s), folder=Path(), out=out, jobs=workers)
            table = compare(batch, self._report, self._runner)
            self.after_s = time.perf_counter() - self._last
            self.before_s = self._jobs_began - began
            self.workers_cpu_s, self.driver_cpu_s = _children_cpu_s() - cpu, time.process_time() - own
        finally:
            shutil.rmtree(out)
        if table is None or set(table["outcome"].to_pylist()) != {"completed"}:
            raise SystemExit("the batch did not complete")
        self.simulation_ms = 1e3 * sum(table["wall_time_s"].to_pylist()) / runs

    def _report(self, done: int, count: int, outcome: str) -> None:
        self._last = time.perf_counter()
        self.memory_mb.append(int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1]) * _PAGE_MB)
        if done == self._workers:
            self._first = self._last

    def _runner(self, jobs: Sequence[Job], count: int) -> Iterator[Done]:
        self._jobs_began = time.perf_counter()
        yield from run_jobs(jobs, count)

    @property
    def runs_per_s(self) -> float:
        """Once every worker has answered."""
        return (self._runs - self._workers) / (self._last - self._first)

    @property
    def worker_ms(self) -> float:
        """Time of one worker for one run."""
        return 1e3 * self._workers / self.runs_per_s

    @property
    def driver_ms(self) -> float:
        """Before the first run and after the last, for each run."""
        return 1e3 * (self.before_s + self.after_s) / self._runs


def _children_cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


_PAGE_MB = os.sysconf("SC_PAGE_SIZE") / 1e6


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=1000, help="short runs for the overhead and the memory")
    parser.add_argument("--pairs", type=int, default=3, help="times that one worker is set against two")
    options = parser.parse_args()
    cores, load = len(os.sched_getaffinity(0)), os.getloadavg()[0]
    print(f"{cores} cores, load {load:.1f} before the start: {'quiet' if load < 0.3 else 'NOT quiet'}\n")

    folder = Path(tempfile.mkdtemp(prefix="surgsim-benchmark-"))
    try:
        parts = parts_ms(min(options.runs, 50), folder)
    finally:
        shutil.rmtree(folder)
    print_table("CPU time of a 0.2 s run", ("part", "median [ms]"), [(n, f"{t:.1f}") for n, t in parts], (1,))
    metrics_ms = sum(t for name, t in parts if name in METRICS or name == "other metrics")
    simulation_ms = sum(t for name, t in parts if name.startswith("simulation"))

    small, batch = Measured(2 * cores, 0.2, cores), Measured(options.runs, 0.2, cores)
    run_cpu_s = (batch.workers_cpu_s - small.workers_cpu_s) / (options.runs - 2 * cores)
    start_cpu_s = (small.workers_cpu_s - 2 * cores * run_cpu_s) / cores
    memory = np.array(batch.memory_mb)
    late = memory[len(memory) // 10 :]
    own_ms = 1e3 * (batch.driver_cpu_s - small.driver_cpu_s) / (options.runs - 2 * cores)
    wall, cpu = batch.worker_ms, 1e3 * run_cpu_s
    rows = [
        ("a worker, per run [ms]", wall, cpu),
        ("of it the simulation [ms]", batch.simulation_ms, simulation_ms),
        ("beside the simulation [ms]", wall - batch.simulation_ms, cpu - simulation_ms),
        ("beside the ticks alone [ms]", None, cpu - dict(parts)["simulation: its ticks"]),
        ("beside simulation and metrics [ms]", None, cpu - simulation_ms - metrics_ms),
        ("driver, per run [ms]", batch.driver_ms, own_ms),
    ]
    text = [(name, *("" if t is None else f"{t:.1f}" for t in times)) for name, *times in rows]
    print_table(f"\n{options.runs} runs of 0.2 s, {cores} workers", ("", "wall", "CPU"), text, (1, 2))
    slope = 1e3 * float(np.polyfit(np.arange(len(late)), late, 1)[0])
    print(f"driver's memory: {late[0]:.1f} MB after a tenth of the runs, {late[-1]:.1f} MB after all;")
    print(f"largest {late.max():.1f} MB, growth {slope:.2f} MB per 1000 runs")

    lines = []
    if not options.pairs:
        return
    for _ in range(options.pairs):
        pair = [Measured(16 * n, 2.0, n) for n in (1, 2)]
        cpus = [(m.workers_cpu_s - n * start_cpu_s) / (16 * n) for n, m in zip((1, 2), pair, strict=True)]
        lines.append((*(m.runs_per_s for m in pair), pair[1].runs_per_s / pair[0].runs_per_s, *cpus))
    lines.append(tuple(statistics.median(column) for column in zip(*lines, strict=True)))
    header = ("one worker", "two workers", "ratio", "CPU s/run, one", "CPU s/run, two")
    text = [tuple(f"{value:.3g}" for value in line) for line in lines]
    print_table("\nruns of 2 s per second; the last line is the median", header, text, (0, 1, 2, 3, 4))


if __name__ == "__main__":
    main()
