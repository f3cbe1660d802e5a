"""`surgsim bench`."""

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from surgsim.cli.paths import path_argument

if TYPE_CHECKING:
    from surgsim.bench.sections import Report

HELP = "measure the speed of simulation and controllers on this machine"
EXAMPLES = """sections:
  ticks      a control tick of each case over the bare mj_steps of its period
  stages     what each stage of the tick costs
  startup    import, building the models, first tick, a run, its recording
  memory     of a process that runs, and what 100 runs leave in it
  batch      runs per second with one worker and with two
  libraries  mink, placo, pink and dqrobotics on the kinematic circle, beside our ticks

Times are processor time, what is compared is measured in turn and medians count, so that a loaded machine
gives the same ratios.

examples:
  surgsim bench
  surgsim bench --only ticks,stages --cases circle/vprnn,kinematic/pinv
  surgsim bench --only libraries --json
  surgsim bench --only ticks --against benchmarks/ratios.json
"""
_HEADINGS = {
    "ticks": "a tick beside bare mj_step of the same model",
    "stages": "stages of a tick [µs]",
    "startup": "starting, CPU time of a fresh process",
    "memory": "largest resident memory of a process",
    "batch": "a batch of short runs",
    "libraries": "the kinematic circle through the port",
}
_COLUMNS = {
    "case": "case",
    "ratio": "ratio",
    "kept": "kept",
    "grown": "grown",
    "tick_us": "tick [µs]",
    "mj_step_us": "mj_step [µs]",
    "real_time_factor": "x real time",
    "cpu_s": "CPU [s]",
    "peak_mb": "[MB]",
    "runs_per_s": "runs/s",
    "cpu_s_per_run": "CPU s/run",
    "runs_per_s_with_a_core_each": "runs/s, a core each",
    "tip_rms_um": "tip [µm]",
    "rcm_rms_um": "RCM [µm]",
}
_PROSE = ("case", "part", "meaning", "moment", "library", "version", "how", "grown")
_EVERY_S = 5.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("--only", metavar="A,B", help="sections to measure; all by default")
    parser.add_argument("--cases", metavar="A,B", help="cases of ticks and stages; all by default")
    parser.add_argument("--duration", type=float, default=10.0, metavar="S", help="simulated time of a run")
    parser.add_argument("--repeat", type=int, default=1, metavar="N", help="runs, processes, batches of each")
    parser.add_argument(
        "--against",
        type=path_argument,
        metavar="FILE",
        help="hold the ratios against those kept there; 1 if one has grown by a quarter",
    )
    parser.add_argument("--keep", type=path_argument, metavar="FILE", help="keep the ratios there")
    parser.add_argument("--json", action="store_true", help="print JSON")


def execute(options: argparse.Namespace) -> int:
    """Measure and print; 1 if a ratio has grown."""
    import json

    from surgsim.bench.kept import against, keep, read_kept
    from surgsim.bench.sections import bench_of, machine, measure
    from surgsim.cli.table import print_prose
    from surgsim.errors import SurgsimError

    bench = bench_of(_names(options.only), _names(options.cases), options.duration, options.repeat)
    if (options.against or options.keep) and "ticks" not in bench.sections:
        raise SurgsimError("bench: --against and --keep are for the section ticks, which --only leaves out")
    if bench.left_out:
        print_prose(f"surgsim: left out: {'; '.join(bench.left_out)}", sys.stderr)
    kept = None if options.against is None else read_kept(options.against)
    found: dict[str, Any] = {"machine": machine()}
    with _progress() as report:
        for section, rows in measure(bench, report):
            found[section] = against(rows, kept) if section == "ticks" and kept is not None else rows
            if not options.json:
                report("")
                _print(section, found[section])
    if options.json:
        print(json.dumps(found, indent=2))
    if options.keep is not None:
        keep(options.keep, found["ticks"], found["machine"])
    return int(any(row.get("grown", False) for row in found.get("ticks", ())))


def _names(text: str | None) -> list[str] | None:
    return None if text is None else [name.strip() for name in text.split(",")]


def _print(section: str, rows: Sequence[dict[str, Any]]) -> None:
    from surgsim.cli.table import print_table

    names = list(rows[0])
    header = [_COLUMNS.get(name, name) for name in names]
    table = [[_cell(name, row[name]) for name in names] for row in rows]
    right = [k for k, name in enumerate(names) if name not in _PROSE]
    print_table(_HEADINGS[section], header, table, right=right)
    print()


def _cell(name: str, value: Any) -> str:
    from surgsim.display import number

    if name == "grown":
        return "yes" if value else ""
    if isinstance(value, float):
        return number(value, 3)
    return "-" if value is None else str(value)


@contextmanager
def _progress() -> "Iterator[Report]":
    """What is measured: a line that is written over on a terminal, else one every few seconds; on stderr."""
    from surgsim.cli.kernels import on_screen
    from surgsim.cli.table import terminal_width

    last_s = [time.perf_counter()]

    def over(text: str) -> None:
        print(f"\r\x1b[K{text[: terminal_width(sys.stderr) - 1]}", end="", file=sys.stderr, flush=True)

    def line(text: str) -> None:
        if text and time.perf_counter() - last_s[0] >= _EVERY_S:
            last_s[0] = time.perf_counter()
            print(text, file=sys.stderr, flush=True)

    if not sys.stderr.isatty():
        yield line
        return
    try:
        with on_screen(over):
            yield over
    finally:
        over("")
