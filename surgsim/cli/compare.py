"""`surgsim compare`."""

import argparse
import shlex
import sys
from collections.abc import Mapping
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

from surgsim.cli.paths import path_argument
from surgsim.cli.scenario_options import add_external, add_matters, add_settings

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
    add_external(parser)
    parser.add_argument("--jobs", type=int, metavar="N", help="worker processes; default: the cores")
    parser.add_argument("--engine", choices=("local", "ray"), default="local", help="where runs are done")
    parser.add_argument("--address", metavar="HOST:PORT", help="the ray cluster's address")
    parser.add_argument("--out", type=path_argument, metavar="DIR", help="folder of the results")
    parser.add_argument("--resume", action="store_true", help="keep what is whole, run what is missing")
    parser.add_argument("--shard", metavar="I/N", default="1/1", help="only every Nth run, from the Ith")
    parser.add_argument("--record", action="store_true", help="write a recording of every run")
    parser.add_argument("--metric", default="rcm_error_rms_mm", help="metric of the leaderboard")
    add_matters(parser)
    parser.add_argument("--json", action="store_true", help="print the leaderboard as JSON")


def execute(options: argparse.Namespace) -> int:
    """Run the suite; 0 when its table is whole, 1 while other shards are missing or if a run crashed."""
    from surgsim.cli.output import show_batch_progress
    from surgsim.cli.table import print_prose
    from surgsim.compare.choice import runner_of, shard_of, workers_for
    from surgsim.compare.engine import Batch, compare
    from surgsim.compare.observations import metric_named
    from surgsim.report.write import write_report
    from surgsim.runs.stop import Stopped

    metric_named(options.metric)  # it is needed after the runs alone
    suite, folder = _suite(options)
    out = options.out or Path("runs") / "suites" / suite.name
    batch = Batch(
        suite=suite,
        folder=folder,
        out=out,
        jobs=workers_for(options.jobs),
        resume=options.resume,
        shard=shard_of(options.shard),
        command="surgsim " + shlex.join(sys.argv[1:]),
    )
    try:
        with redirect_stdout(sys.stderr), show_batch_progress(suite.name) as report:  # ray prints warnings
            table = compare(batch, report, runner_of(options.engine, options.address))
        if table is None:
            print_prose(
                f"{out}: other shards' runs are missing; --resume makes the table once they are there"
            )
            return 1
        _print(table, options, suite.matters)
        print_prose(f"{len(table)} runs; wrote {out / 'runs.csv'}", sys.stderr)
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
    text = f"{len(runs)} of {len(table)} runs crashed or lost their worker: {named}"
    print_prose(f"surgsim: {text}; outcome_detail in runs.csv says how", sys.stderr)
    return 1


def _suite(options: argparse.Namespace):  # type: ignore[no-untyped-def]
    """The suite that the command line means, and the folder of its relative paths."""
    from surgsim.compare.choice import suite_named
    from surgsim.compare.matters import parse_matters
    from surgsim.compare.suite import with_changes

    controllers = None if options.controllers is None else options.controllers.split(",")
    suite, folder = suite_named(options.names)
    matters = parse_matters(options.matters)
    changed = with_changes(suite, controllers, options.seeds, options.record, options.assignments, matters)
    return changed, folder


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
