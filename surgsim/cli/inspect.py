"""`surgsim inspect`."""

import argparse
import json
import math
import shlex
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from surgsim.cli.paths import path_argument

if TYPE_CHECKING:
    from surgsim.recording.read import Recorded
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
    from surgsim.errors import SurgsimError

    for path in options.paths:
        _check_finished(path)
    paths = [_run_of(path, options.run) if options.run else path for path in options.paths]
    if len(paths) == 1 and (paths[0] / "runs.parquet").is_file():
        return _list_batch(paths[0], options)
    if len(paths) == 2:
        return _two(paths, options)
    if len(paths) > 2:
        raise SurgsimError("inspect takes one recording, two, or a batch's folder")
    return _one(paths[0], options)


def _check_finished(path: Path) -> None:
    """Refuse the folder of a batch whose table is not there yet.

    Raises:
        SurgsimError: If it is one, with the command that goes on with it.
    """
    from surgsim.errors import SurgsimError

    if (path / "suite.json").is_file() and not (path / "runs.parquet").is_file():
        runs = len(list(path.glob("runs/*/*/*/metrics.json")))
        raise SurgsimError(
            f"{path}: the batch is not finished: {runs} run{'' if runs == 1 else 's'} there, no table yet. "
            f"To go on: {_command_again(path, '--resume')}"
        )


def _command_again(path: Path, *flags: str) -> str:
    """The command line of the batch in `path`, with `flags`."""
    from surgsim.recording.sealed import read_sealed

    try:
        words = shlex.split(str(read_sealed(path / "suite.json")["command"]))
    except (OSError, ValueError, KeyError):
        words = []
    words = words or ["surgsim", "compare", "SUITE", "--out", str(path)]
    return shlex.join([*words, *(flag for flag in flags if flag not in words)])


def _run_of(path: Path, run_id: str) -> Path:
    from surgsim.compare.table import read_table
    from surgsim.errors import SurgsimError, unknown_name

    table = read_table(path)
    folders = dict(zip(table["run_id"].to_pylist(), table["folder"].to_pylist(), strict=True))
    if run_id not in folders:
        known = list(folders)[:20]
        raise SurgsimError(unknown_name(run_id, f"run of {path}", known))
    folder: Path = path / folders[run_id]
    if not (folder / "recording.rrd").is_file():
        again = _command_again(path, "--resume", "--record")
        raise SurgsimError(
            f"{run_id} was not recorded. To record every run: {again}. "
            f"To record this one: surgsim run {shlex.quote(str(folder / 'scenario.yaml'))} --out DIR"
        )
    return folder


def _one(path: Path, options: argparse.Namespace) -> int:
    from surgsim.errors import Outcome
    from surgsim.metrics.catalog import compute_metrics
    from surgsim.recording import view
    from surgsim.recording.export import check_export, export
    from surgsim.recording.read import read_recording
    from surgsim.recording.stored import differences

    if options.export:
        check_export(options.export)
    recorded = read_recording(path)
    metrics = compute_metrics(recorded.trace)
    found = differences(recorded.metrics, metrics)
    _print(recorded.trace, metrics, found, as_json=options.json)
    if options.export:
        export(recorded.trace, options.export)
        print(f"wrote {options.export}, {len(recorded.trace)} rows", file=sys.stderr)
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
            "controller": scenario["controller"]["name"],
            "seed": scenario["seed"],
            "outcome": trace.meta.ending.to_dict(),
            **judge(trace, metrics).to_dict(),
            "metrics": dict(metrics),
            "differences": found,
        }
        print(json.dumps(whole, indent=2))
        return
    from surgsim.cli.output import print_run

    print_run(trace, metrics)
    print("metrics computed again from the recording " + ("DIFFER:" if found else "equal those stored in it"))
    for line in found:
        print(f"  {line}")


def _two(paths: list[Path], options: argparse.Namespace) -> int:
    from surgsim.errors import SurgsimError
    from surgsim.recording import view
    from surgsim.recording.pair import write_pair
    from surgsim.recording.read import read_recording

    if options.export:
        raise SurgsimError("--export takes one recording")
    pair = [read_recording(path) for path in paths]
    _print_difference(pair, as_json=options.json)
    if not (options.view or options.web or options.out):
        return 0
    file = options.out or Path("runs") / "pair.rrd"
    file.parent.mkdir(parents=True, exist_ok=True)
    write_pair(file, pair)
    print(f"wrote {file}", file=sys.stderr)
    if options.view:
        view.view(file)
    elif options.web:
        view.serve(file)
    return 0


def _print_difference(pair: "list[Recorded]", as_json: bool) -> None:
    from surgsim.cli.output import format_number
    from surgsim.cli.table import print_table
    from surgsim.metrics.catalog import METRICS, compute_metrics

    a, b = (compute_metrics(recorded.trace) for recorded in pair)
    names = [recorded.trace.meta.scenario["controller"]["name"] for recorded in pair]
    gaps = {name: None if a[name] is None or b[name] is None else b[name] - a[name] for name in METRICS}  # type: ignore[operator]
    if as_json:
        print(json.dumps({"a": a, "b": b, "b_minus_a": gaps}, indent=2))
        return
    rows = [
        (name, format_number(a[name]), format_number(b[name]), format_number(gaps[name])) for name in METRICS
    ]
    scenarios = {recorded.trace.meta.scenario["name"] for recorded in pair}
    print_table(" and ".join(sorted(scenarios)), ("metric", *names, "difference"), rows, right=(1, 2, 3))
    largest = format_number(_largest_gap_mm(pair[0].trace, pair[1].trace))
    print(f"\nlargest distance between the two tips: {largest} mm")


def _largest_gap_mm(a: "Trace", b: "Trace") -> float | None:
    """Largest distance of the tips [mm], over the ticks that both have and where both are finite."""
    ticks = min(len(a), len(b))
    gap = a.block("tip")[:ticks] - b.block("tip")[:ticks]
    distances = (math.hypot(*row) for row in gap.tolist())
    found = max((d for d in distances if math.isfinite(d)), default=None)
    return None if found is None else 1e3 * found


def _list_batch(path: Path, options: argparse.Namespace) -> int:
    from surgsim.cli.output import format_number
    from surgsim.cli.table import print_table
    from surgsim.compare.table import read_table

    rows = read_table(path).to_pylist()
    if options.json:
        print(json.dumps(rows, indent=2))
        return 0
    shown = ("tip_error_rms_mm", "rcm_error_rms_mm", "rcm_error_max_mm")
    table = [(row["run_id"], row["outcome"], *(format_number(row[name]) for name in shown)) for row in rows]
    print_table(f"{len(rows)} runs of {path}", ("run", "outcome", *shown), table, right=(2, 3, 4), whole=True)
    if any(row["recording"] for row in rows):
        print(f"\nsurgsim inspect {shlex.quote(str(path))} --run RUN opens one")
    else:
        print(f"\nnone was recorded; to record them: {_command_again(path, '--resume', '--record')}")
    return 0
