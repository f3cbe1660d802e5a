"""`surgsim compare`."""

import argparse
import os
import re
import shlex
import sys
from collections.abc import Mapping
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

from surgsim.cli.paths import path_argument
from surgsim.cli.scenario_options import add_settings

MOST_SHARDS = 10_000
HELP = "run a suite of scenarios and controllers, and compare them"
EXAMPLES = """A suite is a YAML file of scenarios, controllers, a grid of parameters and seeds; scenarios can
be given instead. Every finished run is written at once. After an interruption --resume runs what is
missing.

examples:
  surgsim compare quick
  surgsim compare circle_lwr4plus spiral_lwr4plus --controllers vprnn,qp --seeds 0:5
  surgsim compare quick --set task.radius_m=0.01 --out runs/small
  surgsim compare quick --out results/quick --jobs 2 --resume
  surgsim compare full --out /shared/full --shard 3/8   one of eight array jobs
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("names", nargs="+", metavar="SUITE|SCENARIO", help="one suite, or scenarios")
    parser.add_argument("--controllers", metavar="A,B", help="controllers instead of the suite's")
    parser.add_argument("--seeds", metavar="0:10", help="seeds instead of the suite's: 0:10, 3 or 1,4,9")
    add_settings(parser, "change one value in every run; may be given again")
    parser.add_argument("--jobs", type=int, metavar="N", help="worker processes; default: the cores")
    parser.add_argument("--engine", choices=("local", "ray"), default="local", help="where runs are done")
    parser.add_argument("--address", metavar="HOST:PORT", help="the ray cluster's address")
    parser.add_argument("--out", type=path_argument, metavar="DIR", help="folder of the results")
    parser.add_argument("--resume", action="store_true", help="keep what is whole, run what is missing")
    parser.add_argument("--shard", metavar="I/N", default="1/1", help="only every Nth run, from the Ith")
    parser.add_argument("--record", action="store_true", help="write a recording of every run")
    parser.add_argument("--metric", default="rcm_error_rms_mm", help="metric of the leaderboard")
    parser.add_argument(
        "--matters",
        action="append",
        default=[],
        metavar="METRIC=VALUE",
        help="smallest difference that matters",
    )
    parser.add_argument("--json", action="store_true", help="print the leaderboard as JSON")


def execute(options: argparse.Namespace) -> int:
    """Run the suite; 0 when its table is whole, 1 while other shards are missing or if a run crashed."""
    from surgsim.cli.output import show_batch_progress
    from surgsim.cli.table import print_prose
    from surgsim.compare.engine import Batch, compare
    from surgsim.report.write import write_report
    from surgsim.runs.stop import Stopped

    _check(options)
    suite, folder = _suite(options)
    out = options.out or Path("runs") / "suites" / suite.name
    batch = Batch(
        suite=suite,
        folder=folder,
        out=out,
        jobs=_jobs(options.jobs),
        resume=options.resume,
        shard=_shard(options.shard),
        command="surgsim " + shlex.join(sys.argv[1:]),
    )
    try:
        with redirect_stdout(sys.stderr), show_batch_progress(suite.name) as report:  # ray prints warnings
            table = compare(batch, report, _runner(options))
        if table is None:
            print_prose(
                f"{out}: other shards' runs are missing; --resume makes the table once they are there"
            )
            return 1
        _print(table, options, suite.matters)
        print_prose(f"{table.num_rows} runs; wrote {out / 'runs.parquet'} and runs.csv", sys.stderr)
        print_prose(f"wrote {write_report(out)}", sys.stderr)
    except Stopped as stopped:
        print_prose(f"surgsim: {stopped.told}; --resume --out {out} runs what is missing", sys.stderr)
        return stopped.exit_status
    return _tell_broken(table)


def _tell_broken(table: Any) -> int:
    """Say which runs broke surgsim itself; 1 if there are any, else 0."""
    from surgsim.cli.table import print_prose
    from surgsim.compare.job import broken

    runs = broken(table)
    if not runs:
        return 0
    named = ", ".join(runs[:3]) + (f" and {len(runs) - 3} more" if len(runs) > 3 else "")
    text = f"{len(runs)} of {table.num_rows} runs crashed or lost their worker: {named}"
    print_prose(f"surgsim: {text}; outcome_detail in runs.csv says how", sys.stderr)
    return 1


def _check(options: argparse.Namespace) -> None:
    """Refuse what would only be found wrong after the runs.

    Raises:
        SurgsimError: If there is such a thing.
    """
    from surgsim.compare.observations import metric_named
    from surgsim.errors import SurgsimError

    metric_named(options.metric)
    if options.address and options.engine != "ray":
        raise SurgsimError("--address is for --engine ray")


def _suite(options: argparse.Namespace):  # type: ignore[no-untyped-def]
    """The suite that the command line means, and the folder of its relative paths."""
    from surgsim.compare.matters import parse_matters
    from surgsim.compare.suite import ad_hoc_suite, is_suite, load_suite, with_changes
    from surgsim.errors import SurgsimError

    names, controllers = (
        options.names,
        None if options.controllers is None else options.controllers.split(","),
    )
    _check_name(names[0])
    if is_suite(names[0]):
        if len(names) > 1:
            raise SurgsimError("give one suite, or scenarios; not both")
        suite, folder = load_suite(names[0])
    else:
        suite, folder = ad_hoc_suite(names, None), Path()
    changed = with_changes(
        suite,
        controllers,
        options.seeds,
        options.record,
        options.assignments,
        parse_matters(options.matters),
    )
    return changed, folder


def _check_name(name: str) -> None:
    """Refuse a name that is neither a shipped suite's nor a scenario's, and no path.

    Raises:
        SurgsimError: If it is such a name.
    """
    from surgsim.errors import SurgsimError, unknown_name
    from surgsim.scenario.load import shipped

    known = [*shipped("suites"), *shipped()]
    if name not in known and len(Path(name).parts) < 2 and not Path(name).suffix:
        raise SurgsimError(f"{unknown_name(name, 'shipped suite or scenario', known)} Or give a .yaml file.")


def _jobs(jobs: int | None) -> int:
    from surgsim.errors import SurgsimError

    if jobs is None:
        return len(os.sched_getaffinity(0))
    if jobs < 1:
        raise SurgsimError(f"--jobs: {jobs} is not allowed: must be 1 or more")
    return jobs


def _shard(text: str) -> tuple[int, int]:
    from surgsim.errors import SurgsimError

    found = re.fullmatch(r"([0-9]{1,5})/([0-9]{1,5})", text)
    i, n = (int(found[1]), int(found[2])) if found else (0, 0)
    if not 1 <= i <= n <= MOST_SHARDS:
        raise SurgsimError(f"--shard: '{text[:60]}' is not I/N with 1 <= I <= N <= {MOST_SHARDS}")
    return i, n


def _runner(options: argparse.Namespace):  # type: ignore[no-untyped-def]
    """What runs the jobs."""
    if options.engine == "local":
        from surgsim.compare.workers import run_jobs

        return run_jobs
    from surgsim.compare.ray_engine import ray_runner

    return ray_runner(options.address)


def _print(table: Any, options: argparse.Namespace, matters: Mapping[str, float]) -> None:
    import json

    from surgsim.cli.output import print_leaderboard, print_paragraphs
    from surgsim.compare.leaderboard import leaderboard
    from surgsim.compare.observations import Observations
    from surgsim.compare.summary import summary

    runs = Observations.of(table, matters)
    rows = leaderboard(runs, options.metric)
    if options.json:
        print(json.dumps(rows, indent=2, default=vars))
    else:
        print_paragraphs(summary(runs, options.metric, rows).lines)
        print_leaderboard(options.metric, rows, len(set(runs.parameters.tolist())))
