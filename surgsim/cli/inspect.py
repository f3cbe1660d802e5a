"""`surgsim inspect`."""

import argparse
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from surgsim.cli.paths import path_argument

if TYPE_CHECKING:
    from surgsim.trace.trace import Trace

HELP = "look into a recorded run, two of them, or a batch"
EXAMPLES = """The metrics are computed again from the recording alone and compared with those stored in it.
Two runs are compared and shown side by side on one timeline. A batch's folder lists its runs.

examples:
  surgsim inspect runs/circle_lwr4plus/vprnn-seed0
  surgsim inspect recording.rrd --view
  surgsim inspect recording.rrd --export run.parquet
  surgsim inspect runs/one runs/another --view
  surgsim inspect runs/suites/quick
  surgsim inspect runs/suites/quick --run circle_lwr4plus/vprnn/base-seed0
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument(
        "paths",
        type=path_argument,
        nargs="+",
        metavar="FILE.rrd|DIR",
        help="a recording, a run's or a batch's folder",
    )
    shown = parser.add_mutually_exclusive_group()
    shown.add_argument("--view", action="store_true", help="open the viewer")
    shown.add_argument("--web", action="store_true", help="serve the viewer on 127.0.0.1 for a browser")
    parser.add_argument("--run", metavar="RUN_ID", help="which run of a batch's folder")
    parser.add_argument(
        "--out", type=path_argument, metavar="FILE.rrd", help="where two runs' recording is kept"
    )
    parser.add_argument(
        "--export", type=path_argument, metavar="FILE.parquet|.csv", help="write every control tick"
    )
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")


def execute(options: argparse.Namespace) -> int:
    """Print what was asked for; 1 if metrics differ from those stored, or a run did not complete."""
    from surgsim.cli.inspect_folder import check_finished, check_recorded, list_batch, run_of
    from surgsim.cli.inspect_pair import inspect_two
    from surgsim.compare.unfinished import has_table
    from surgsim.errors import SurgsimError

    for path in options.paths:
        check_finished(path)
    paths = [run_of(path, options.run) if options.run else path for path in options.paths]
    if len(paths) == 1 and has_table(paths[0]):
        list_batch(paths[0], options.json)
        return 0
    if len(paths) > 2:
        raise SurgsimError("inspect takes one recording, two, or a batch's folder")
    for path in paths:
        check_recorded(path)
    return inspect_two(paths, options) if len(paths) == 2 else _one(paths[0], options)


def _one(path: Path, options: argparse.Namespace) -> int:
    from surgsim.cli.table import print_prose
    from surgsim.errors import Outcome
    from surgsim.metrics.catalog import evaluate
    from surgsim.recording import view
    from surgsim.recording.export import check_export, export
    from surgsim.recording.read import read_recording
    from surgsim.recording.stored import differences

    if options.export:
        check_export(options.export)
    recorded = read_recording(path)
    evaluation = evaluate(recorded.trace)
    missing = evaluation.missing(recorded.metrics)
    metrics = {**evaluation.values, **{name: recorded.metrics[name] for name in missing}}
    found = differences(recorded.metrics, metrics)
    _print(recorded.trace, metrics, found, as_json=options.json)
    for name, reason in missing.items():
        print_prose(f"{name} is as stored; it cannot be computed again here: {reason}", sys.stderr)
    if options.export:
        export(recorded.trace, options.export)
        print_prose(f"wrote {options.export}, {len(recorded.trace)} rows", sys.stderr)
    if options.view:
        view.view(path)
    elif options.web:
        view.serve(path)
    return 0 if not found and recorded.trace.meta.ending.outcome is Outcome.COMPLETED else 1


def _print(trace: "Trace", metrics: Mapping[str, float | None], found: list[str], as_json: bool) -> None:
    if as_json:
        from surgsim.verdict import judge

        scenario = trace.meta.scenario
        whole = {
            "scenario": scenario["name"],
            "controller": trace.meta.controller,
            "seed": scenario["seed"],
            "outcome": trace.meta.ending.to_dict(),
            **judge(trace, metrics).to_dict(),
            "metrics": dict(metrics),
            "differences": found,
        }
        print(json.dumps(whole, indent=2))
        return
    from surgsim.cli.output import print_run
    from surgsim.cli.table import print_prose

    print_run(trace, metrics)
    equal = "DIFFER:" if found else "equal those stored in it"
    print_prose(f"metrics computed again from the recording {equal}")
    for line in found:
        print_prose(f"  {line}")
