"""`surgsim run`."""

import argparse
import itertools
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from surgsim.cli.paths import path_argument
from surgsim.cli.scenario_options import add_scenario_options, naming_file

if TYPE_CHECKING:
    from surgsim.scenario.arms import Experiment
    from surgsim.scenario.schema import Scenario

_LIVE = ("keyboard", "gamepad")
HELP = "run a scenario and write its folder"
EXAMPLES = """The folder holds scenario.yaml (every default explicit; running it again gives the same trace),
metrics.json and recording.rrd. It appears when the run is whole.

examples:
  surgsim run circle_lwr4plus
  surgsim run circle_lwr4plus --controller vprnn --seed 3 --out runs/mine
  surgsim run circle_lwr4plus --set trocar.position_m='[0, 0.55, 0.2]'
  surgsim run circle_lwr4plus --live
  surgsim run peg_and_ring_panda --operator keyboard
  surgsim run my_scenario.yaml --json | jq .metrics.rcm_error_max_mm
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("scenario", metavar="SCENARIO", help="a YAML file or the name of a shipped scenario")
    add_scenario_options(parser)
    parser.add_argument("--out", type=path_argument, metavar="DIR", help="the run's folder")
    parser.add_argument(
        "--operator",
        metavar="keyboard|gamepad|FILE.csv",
        help="operate a teleoperation yourself, in a window; or play an operator_input.csv again",
    )
    parser.add_argument(
        "--live",
        nargs="?",
        const="",
        metavar="HOST:PORT",
        help="show the run in the viewer while it goes on: in a window, or in a viewer at an address",
    )
    parser.add_argument(
        "--pace",
        choices=("realtime", "free"),
        default="realtime",
        help="with --live: as fast as the clock, or as fast as it goes; default: %(default)s",
    )
    parser.add_argument("--no-record", action="store_true", help="write no recording.rrd")
    parser.add_argument("--json", action="store_true", help="print metrics.json instead of a table")


def execute(options: argparse.Namespace) -> int:
    """Run the scenario; 0 when it completed."""
    from surgsim.cli.kernels import compiled_by_two

    with compiled_by_two() as runs:
        return _execute(options, runs)


def _execute(options: argparse.Namespace, runs: Callable[["Experiment"], None]) -> int:
    """Run the scenario, and tell `runs` of it first."""
    from surgsim.cli.output import print_run, show_progress
    from surgsim.cli.table import print_prose
    from surgsim.errors import Outcome, SurgsimError, UnreachableError
    from surgsim.packages import RECORDING, require
    from surgsim.runs.folder import check_recordable, run_to_folder
    from surgsim.runs.part_origins import check_parts
    from surgsim.scenario.load import load_experiment

    if options.live is not None and options.operator is not None:
        raise SurgsimError(
            "--live and --operator do not go together: a person who operates sees the scene already"
        )
    scenario = load_experiment(
        options.scenario, controller=options.controller, assignments=options.assignments, seed=options.seed
    )
    check_parts([scenario])
    operator, record = options.operator, not options.no_record
    check_recordable(record, "--no-record")
    if options.live is not None:
        require("--live needs", *RECORDING)
    name = f"{scenario.controller_name}-seed{scenario.seed}"
    folder = options.out or _default_folder(Path("runs") / scenario.name, name, operator)
    shown = show_progress(f"{scenario.name} {scenario.controller_name}", operator in _LIVE)
    runs(scenario)
    with shown as progress:
        try:
            if options.live is not None:
                from surgsim.live.showing import run_shown

                realtime = options.pace == "realtime"
                result = run_shown(
                    scenario,
                    folder,
                    options.live or None,
                    realtime=realtime,
                    record=record,
                    progress=progress,
                )
            elif operator is None:
                result = run_to_folder(scenario, folder, record=record, progress=progress)
            else:
                from surgsim.live.operate import operate

                result = operate(_operated(scenario), operator, folder, record=record, progress=progress)
        except UnreachableError as error:
            raise naming_file(options.scenario, error) from error
    ending = result.trace.meta.ending
    if options.json:
        print(_stored(folder / "metrics.json"), end="")
    else:
        print_run(result.trace, result.metrics)
    speed = f"{result.wall_time_s:.1f} s, {result.real_time_factor:.1f}x real time"
    print_prose(f"simulated {ending.t_s:.1f} s in {speed}; wrote {folder}", sys.stderr)
    return 0 if ending.outcome is Outcome.COMPLETED else 1


def _operated(scenario: "Experiment") -> "Scenario":
    """The scenario, for a person to operate.

    Raises:
        SurgsimError: If it has several arms.
    """
    from surgsim.errors import SurgsimError
    from surgsim.scenario.schema import Scenario

    if not isinstance(scenario, Scenario):
        raise SurgsimError(
            f"{scenario.name}: --operator takes a scenario of one arm; several are watched with --live"
        )
    return scenario


def _stored(file: Path) -> str:
    """The text of a file that was just written.

    Raises:
        SurgsimError: If the disk does not give it back.
    """
    from surgsim.errors import SurgsimError

    try:
        return file.read_text(encoding="utf-8")
    except OSError as error:
        raise SurgsimError(f"{file}: written, but cannot be read: {error.strerror or error}") from error


def _default_folder(parent: Path, name: str, operator: str | None) -> Path:
    """Where a run goes; one that a person operated gets a number, so that it never replaces another."""
    if operator is None:
        return parent / name
    kind = operator if operator in _LIVE else "replay"
    numbered = (parent / f"{name}-{kind}{number}" for number in itertools.count(1))
    return next(folder for folder in numbered if not folder.exists())
