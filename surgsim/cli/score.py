"""`surgsim score`."""

import argparse
import shlex
import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING

from surgsim.cli.paths import path_argument
from surgsim.cli.scenario_options import add_external

if TYPE_CHECKING:
    from surgsim.protocol.score import Means, Score, Wish

HELP = "take a controller through the frozen protocol: scorecard and robustness passport"
EXAMPLES = """The controller is a YAML file, the name of a shipped one or of an installed policy, or a program
given by --external. Every finished run is kept in the store by the hash of all that it follows from, and is
never run again while that is the same: what was interrupted goes on by the same command.

examples:
  surgsim score rcm_inverse_dynamics
  surgsim score my.yaml --track nominal --jobs 4
  surgsim score --external mine='python my_controller.py'
  surgsim score my.yaml --seeds 2027-1 --out scores/mine
  surgsim score my.yaml --store /shared/store --shard 3/8    one of eight array jobs
  surgsim score --all --out results/surgsim_v1               the leaderboard
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("controller", nargs="?", metavar="CONTROLLER|POLICY", help="what is scored")
    parser.add_argument(
        "--track", metavar="T", help="track; default: the first that the controller may enter"
    )
    parser.add_argument("--scheme", default="", metavar="S", help="scheme, in a track that has some")
    parser.add_argument("--arms", metavar="A,B", help="arms; default: all of the protocol")
    parser.add_argument(
        "--seeds", default="development", metavar="ROUND", help="development, or an open round"
    )
    parser.add_argument("--protocol", metavar="NAME", help="name or .yaml file; default: surgsim_v1")
    add_external(parser)
    parser.add_argument(
        "--tuning-runs", type=int, metavar="N", help="runs that its gains took, as you declare"
    )
    parser.add_argument("--jobs", type=int, metavar="N", help="worker processes; default: the cores")
    parser.add_argument("--engine", choices=("local", "ray"), default="local", help="where runs are done")
    parser.add_argument("--address", metavar="HOST:PORT", help="the ray cluster's address")
    parser.add_argument("--shard", metavar="I/N", default="1/1", help="only every Nth run, from the Ith")
    parser.add_argument("--out", type=path_argument, metavar="DIR", help="folder of the score")
    parser.add_argument(
        "--store", type=path_argument, metavar="DIR", help="finished runs; default: runs/store"
    )
    parser.add_argument(
        "--beside",
        action="append",
        type=path_argument,
        default=[],
        metavar="DIR",
        help="draw the passport beside these scores; may be given again",
    )
    parser.add_argument("--all", action="store_true", help="every entry of the protocol: the leaderboard")
    parser.add_argument("--resume", action="store_true", help="make a score again that is there")
    parser.add_argument("--json", action="store_true", help="print score.json")


def execute(options: argparse.Namespace) -> int:
    """Score; 1 while other shards' runs are missing, or if a run crashed or lost its worker."""
    from surgsim.cli.table import print_prose
    from surgsim.runs.stop import Stopped

    try:
        return _all(options) if options.all else _one(options)
    except Stopped as stopped:
        text = f"surgsim: {stopped.told}; what is finished is in {_store(options)}, the same command goes on"
        print_prose(text, sys.stderr)
        return stopped.exit_status


def _one(options: argparse.Namespace) -> int:
    """The score of one controller."""
    import json

    from surgsim.cli.output import show_batch_progress
    from surgsim.cli.score_table import print_score
    from surgsim.cli.table import print_prose
    from surgsim.protocol.passport_files import write_passport
    from surgsim.protocol.reading import baselines_of, scores_below, why_none_beside
    from surgsim.protocol.score import check_out, score, write_score

    wish = _wish(options)
    out = options.out or Path("runs") / "scores" / wish.protocol.name / wish.track / wish.entrant.name
    check_out(out, resume=options.resume)
    others = [other for folder in options.beside for other in scores_below(folder)]
    with redirect_stdout(sys.stderr), show_batch_progress(f"{wish.entrant.name}, {wish.track}") as report:
        found = score(wish, _means(options), report)
    if found is None:
        print_prose(f"{_store(options)}: other shards' runs are missing; the same command goes on")
        return 1
    write_score(out, found)
    beside = baselines_of(found, others, wish.protocol)
    left_out = write_passport(out, found, beside, wish.protocol.config)
    if others and not beside:
        print_prose(f"surgsim: {why_none_beside(found, others)}", sys.stderr)
    if options.json:
        print(json.dumps(found.content, indent=2))
    else:
        print_score(found, wish.protocol.config)
    if left_out:
        print_prose(left_out, sys.stderr)
    print_prose(f"wrote {out / 'score.json'}, rows.jsonl and passport.html", sys.stderr)
    return _tell_broken([found])


def _all(options: argparse.Namespace) -> int:
    """The leaderboard."""
    from surgsim.cli.output import show_batch_progress
    from surgsim.cli.table import print_prose
    from surgsim.errors import SurgsimError
    from surgsim.protocol.board import Board, make_board
    from surgsim.protocol.definition import CURRENT, load_protocol
    from surgsim.protocol.entrants import check_entries
    from surgsim.protocol.seeds import seeds_of

    if options.controller is not None:
        raise SurgsimError(f"--all scores the protocol's own entries: leave '{options.controller}' out")
    protocol = load_protocol(options.protocol or CURRENT)
    out = options.out or Path("runs") / "scores" / protocol.name
    board = Board(
        protocol=protocol,
        tracks=tuple(protocol.config.tracks) if options.track is None else (options.track,),
        arms=protocol.arms_of(options.arms),
        seeds=seeds_of(protocol, options.seeds),
        out=out,
    )
    check_entries(protocol, board.tracks)
    with redirect_stdout(sys.stderr):
        made = make_board(
            board, _means(options), show_batch_progress, lambda text: print_prose(text, sys.stderr)
        )
    if made is None:
        print_prose(f"{_store(options)}: other shards' runs are missing; the same command goes on")
        return 1
    print_prose(str(out / "index.html"))
    return _tell_broken(made)


def _wish(options: argparse.Namespace) -> "Wish":
    from surgsim.errors import SurgsimError
    from surgsim.protocol.definition import CURRENT, load_protocol
    from surgsim.protocol.entrants import check_known, entrant, track_for
    from surgsim.protocol.score import Wish
    from surgsim.protocol.seeds import seeds_of

    protocol = load_protocol(options.protocol or CURRENT)
    if options.controller is None and not options.externals:
        raise SurgsimError("give a controller, --external NAME=COMMAND, or --all")
    if options.controller is not None:
        check_known(options.controller)
    who = entrant(options.controller, tuning_runs=options.tuning_runs, scheme=options.scheme)
    track = track_for(protocol, who, options.track)
    protocol.settings_of(track, options.scheme)
    return Wish(
        protocol=protocol,
        track=track,
        arms=protocol.arms_of(options.arms),
        seeds=seeds_of(protocol, options.seeds),
        entrant=who,
    )


def _means(options: argparse.Namespace) -> "Means":
    from surgsim.compare.choice import runner_of, shard_of, workers_for
    from surgsim.protocol.runs import Store
    from surgsim.protocol.score import Means

    return Means(
        store=Store(folder=_store(options)),
        jobs=workers_for(options.jobs),
        runner=runner_of(options.engine, options.address),
        shard=shard_of(options.shard),
        command="surgsim " + shlex.join(sys.argv[1:]),
    )


def _store(options: argparse.Namespace) -> Path:
    return options.store or Path("runs") / "store"


def _tell_broken(scores: "list[Score]") -> int:
    """Say which runs broke surgsim itself; 1 if there are any, else 0."""
    from surgsim.cli.table import print_prose

    cells = [f"{score.name}: {cell}" for score in scores for cell in score.broken]
    if not cells:
        return 0
    named = ", ".join(cells[:3]) + (f" and {len(cells) - 3} more" if len(cells) > 3 else "")
    text = (
        f"surgsim: {len(cells)} runs crashed or lost their worker: {named}; the same command tries them again"
    )
    print_prose(text, sys.stderr)
    return 1
