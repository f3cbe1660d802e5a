"""`surgsim inspect`."""

import argparse
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from surgsim.trace.trace import Trace

HELP = "look into a recorded run"
EXAMPLES = """The metrics are computed again from the recording alone and compared with those stored in it.

examples:
  surgsim inspect runs/circle_lwr4plus/vprnn-seed0
  surgsim inspect recording.rrd --view
  surgsim inspect recording.rrd --export run.parquet
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("path", type=Path, metavar="FILE.rrd|RUN_DIR", help="a recording or a run's folder")
    shown = parser.add_mutually_exclusive_group()
    shown.add_argument("--view", action="store_true", help="open the viewer")
    shown.add_argument("--web", action="store_true", help="serve the viewer on 127.0.0.1 for a browser")
    parser.add_argument(
        "--export", type=Path, metavar="FILE.parquet|FILE.csv", help="write every control tick"
    )
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")


def execute(options: argparse.Namespace) -> int:
    """Print the metrics; 1 if they differ from those stored, or if the run did not complete."""
    from surgsim.errors import Outcome
    from surgsim.metrics.catalog import compute_metrics
    from surgsim.recording.export import export
    from surgsim.recording.read import read_recording
    from surgsim.recording.stored import differences

    recorded = read_recording(options.path)
    metrics = compute_metrics(recorded.trace)
    found = differences(recorded.metrics, metrics)
    _print(recorded.trace, metrics, found, as_json=options.json)
    if options.export:
        export(recorded.trace, options.export)
        print(f"wrote {options.export}, {len(recorded.trace)} rows", file=sys.stderr)
    _show(options)
    return 0 if not found and recorded.trace.meta.ending.outcome is Outcome.COMPLETED else 1


def _print(trace: "Trace", metrics: Mapping[str, float | None], found: list[str], as_json: bool) -> None:
    ending = trace.meta.ending
    scenario = trace.meta.scenario
    if as_json:
        whole = {
            "scenario": scenario["name"],
            "controller": scenario["controller"]["name"],
            "seed": scenario["seed"],
            "outcome": ending.to_dict(),
            "metrics": dict(metrics),
            "differences": found,
        }
        print(json.dumps(whole, indent=2))
        return
    from surgsim.cli.output import print_metrics

    print_metrics(f"{scenario['name']}, {scenario['controller']['name']}, seed {scenario['seed']}", metrics)
    detail = f" {ending.detail}." if ending.detail else ""
    print(f"\n{ending.outcome.name.lower()} at {ending.t_s:.3f} s: {ending.outcome.value}{detail}")
    print("metrics computed again from the recording " + ("DIFFER:" if found else "equal those stored in it"))
    for line in found:
        print(f"  {line}")


def _show(options: argparse.Namespace) -> None:
    from surgsim.recording import view

    if options.view:
        view.view(options.path)
    elif options.web:
        view.serve(options.path)
