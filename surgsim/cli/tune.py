"""`surgsim tune`."""

import argparse
import itertools
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from surgsim.cli.paths import path_argument
from surgsim.cli.scenario_options import add_external, add_settings

if TYPE_CHECKING:
    from surgsim.tuning.trials import Trials
    from surgsim.tuning.tuning import Tuning

HELP = "tune a controller's gains by runs, and measure how far they are from failing"
EXAMPLES = """Searches the gains of torque law and resolver by CMA-ES, each within a factor of 30 of its value
in the controller's file; a list keeps its ratios. What fails is worse than what is inaccurate. Then delay
and gain margin of the best gains are measured. The folder holds the tuned controller's file, tuning.json,
and every run; after an interruption --resume goes on. Seeds begin at 1000: evaluate with others.

examples:
  surgsim tune rcm_inverse_dynamics --scenario theatre_panda --budget 600
  surgsim tune my.yaml --scenario circle_lwr4plus --scenario spiral_lwr4plus --budget 300 --jobs 2
  surgsim tune vprnn --scenario circle_panda --budget 200 --keys resolver.beta,resolver.k1,resolver.k2
  surgsim run theatre_panda --controller runs/tuned/rcm_inverse_dynamics/rcm_inverse_dynamics_tuned.yaml
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("controller", metavar="CONTROLLER", help="a YAML file or the name of a shipped one")
    parser.add_argument(
        "--scenario",
        action="append",
        required=True,
        dest="scenarios",
        metavar="SCENARIO",
        help="a scenario to tune on; may be given again",
    )
    parser.add_argument(
        "--budget", type=int, required=True, metavar="N", help="runs that the search may take"
    )
    parser.add_argument("--seeds", default="1000:1003", metavar="1000:1003", help="tuning seeds")
    parser.add_argument("--keys", metavar="A,B", help="gains to tune, such as torque_law.rcm_damping_ratio")
    parser.add_argument("--seed", type=int, default=0, metavar="K", help="the optimiser's seed; default: 0")
    add_settings(parser, "change one value in every run; may be given again")
    add_external(parser)
    parser.add_argument("--jobs", type=int, metavar="N", help="worker processes; default: the cores")
    parser.add_argument("--out", type=path_argument, metavar="DIR", help="folder of the results")
    parser.add_argument("--resume", action="store_true", help="go on with the runs that the folder holds")
    parser.add_argument("--json", action="store_true", help="print tuning.json instead of tables")


def execute(options: argparse.Namespace) -> int:
    """Tune, write the folder and print what came of it; 1 if a run crashed or lost its worker."""
    from surgsim.cli.table import print_prose
    from surgsim.compare.choice import workers_for
    from surgsim.compare.workers import kept_workers
    from surgsim.runs.stop import Stopped
    from surgsim.tuning.files import controller_file, open_folder, summary_of, write_tuning
    from surgsim.tuning.prepare import prepare
    from surgsim.tuning.tune import trials_in
    from surgsim.tuning.tuning import Wish

    wish = Wish(
        controller=options.controller,
        scenarios=tuple(options.scenarios),
        seeds=options.seeds,
        budget=options.budget,
        keys=None if options.keys is None else tuple(options.keys.split(",")),
        settings=tuple(options.assignments),
        seed=options.seed,
    )
    jobs, tuning = workers_for(options.jobs), prepare(wish)
    folder = options.out or Path("runs") / "tuned" / tuning.controller.name
    open_folder(folder, tuning, resume=options.resume)
    try:
        with trials_in(folder, kept_workers(jobs)) as trials:
            _run(tuning, trials)
    except Stopped as stopped:
        best = ""
        if tuning.tried:
            write_tuning(folder, tuning, finished=False)
            best = f"the best so far is in {folder / controller_file(tuning)}; "
        text = f"surgsim: {stopped.told}; {best}--resume --out {folder} goes on"
        print_prose(text, sys.stderr)
        return stopped.exit_status
    write_tuning(folder, tuning, finished=True)
    if options.json:
        print(json.dumps(summary_of(tuning, finished=True), indent=2))
    else:
        _print(tuning)
    print_prose(f"{tuning.runs} runs; wrote {folder / controller_file(tuning)} and tuning.json", sys.stderr)
    return _tell_broken(tuning)


def _run(tuning: "Tuning", trials: "Trials") -> None:
    """Search, then measure the margins, with the progress of a batch."""
    from surgsim.cli.output import show_batch_progress
    from surgsim.tuning.margins import measure_margins, most_runs
    from surgsim.tuning.tune import search

    steps = (
        (f"tuning {tuning.controller.name}", tuning.budgeted, search),
        ("margins", most_runs(tuning), measure_margins),
    )
    for label, total, step in steps:
        with show_batch_progress(label) as report:
            step(tuning, trials, _counting(report, total))


def _counting(report: Callable[[int, int, str], None], total: int) -> Callable[[str], None]:
    """What is told of one run after the other, and tells `report` how many of `total` are done."""
    numbers = itertools.count(1)
    return lambda outcome: report(next(numbers), total, outcome)


def _print(tuning: "Tuning") -> None:
    """Print metrics and gains before and after, and the margins."""
    from surgsim.cli.output import print_paragraphs
    from surgsim.cli.table import print_table
    from surgsim.display import count, number
    from surgsim.tuning.files import margin_lines
    from surgsim.tuning.tuning import means

    before, best, rows = tuning.before, tuning.best, []
    for name in tuning.scenario_names:
        old, new = means(before.trials, name), means(best.trials, name)
        rows += [(name, key, number(old.get(key)), number(new.get(key))) for key in {**old, **new}]
    seeds = count(len(tuning.scenarios) // len(tuning.scenario_names), "tuning seed")
    header = ("before", "after")
    print_table(f"means over {seeds}", ("scenario", "metric", *header), rows, right=(2, 3))
    print()
    gains = [
        (gain.key, *(_shown(candidate.values[gain.key]) for candidate in (before, best)))
        for gain in tuning.gains
    ]
    print_table("gains", ("gain", *header), gains)
    print()
    lines = [f"Cost: {number(before.cost)} before, {number(best.cost)} after.", *margin_lines(tuning.margins)]
    edge = [gain.key for gain in tuning.gains if gain.is_at_the_edge(best.values[gain.key])]
    if edge:
        lines.append(f"At the edge of the search: {', '.join(edge)}.")
    if best is before:
        lines.append("Nothing better was found: the file holds the gains as they were.")
    print_paragraphs(lines)


def _shown(value: "float | tuple[float, ...]") -> str:
    from surgsim.scenario.messages import show

    return show(list(value) if isinstance(value, tuple) else value, 200)


def _tell_broken(tuning: "Tuning") -> int:
    """Say which runs broke surgsim itself; 1 if there are any, else 0."""
    from surgsim.cli.table import print_prose

    if not tuning.broken:
        return 0
    first = tuning.broken[0]
    told = f"{first.scenario}, seed {first.seed}: {' '.join(first.detail.split())}"
    print_prose(f"surgsim: {len(tuning.broken)} runs crashed or lost their worker: {told}", sys.stderr)
    return 1
