"""`surgsim verify`."""

import argparse
import sys
from contextlib import redirect_stdout
from typing import TYPE_CHECKING

from surgsim.cli.paths import path_argument
from surgsim.cli.scenario_options import add_external

if TYPE_CHECKING:
    from surgsim.protocol.bundle import Bundle
    from surgsim.protocol.verify import Verification

HELP = "check a bundle, and run a part of it again"
EXAMPLES = """Checked are the archive, every hash, the protocol, the round that gave the seeds, that each
of the protocol's runs is there once with its own scenario, the scorecard, and that code, packages and weights
here are the bundle's. Then a random part of the runs is done again: bit for bit on the same platform, within
the tolerance on another. Exit status: 0 verified, 1 something differs (a line for each), 2 no bundle.

examples:
  surgsim verify mine.zip
  surgsim verify mine.zip --all --jobs 4
  surgsim verify mine.zip --fraction 0.2 --sample 7
  surgsim verify mine.zip --protocol my_protocol.yaml --json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("bundle", type=path_argument, metavar="BUNDLE", help="what surgsim submit wrote")
    parser.add_argument("--all", action="store_true", help="run every run again")
    parser.add_argument(
        "--fraction", type=float, metavar="F", help="share of the runs that is run again; default: 0.05"
    )
    parser.add_argument(
        "--sample", type=int, metavar="SEED", help="seed of their choice; default: one that nobody knows"
    )
    parser.add_argument(
        "--tolerance",
        type=float,
        metavar="T",
        help="how far numbers may be off on another platform, in what matters of the metric, "
        "or of the number itself; default: 0.01",
    )
    parser.add_argument("--jobs", type=int, metavar="N", help="worker processes; default: the cores")
    parser.add_argument(
        "--protocol", metavar="FILE", help="file of the bundle's protocol, if it is no shipped one"
    )
    add_external(parser)
    parser.add_argument("--json", action="store_true", help="print JSON")


def execute(options: argparse.Namespace) -> int:
    """Verify; 1 if something differs."""
    import secrets

    from surgsim.cli.output import show_batch_progress
    from surgsim.cli.table import print_prose
    from surgsim.compare.choice import workers_for
    from surgsim.errors import SurgsimError
    from surgsim.protocol.bundle import read_bundle
    from surgsim.protocol.definition import load_protocol
    from surgsim.protocol.submit import protocol_for
    from surgsim.protocol.verify import FRACTION, TOLERANCE, Effort, check_fraction, verify
    from surgsim.runs.stop import Stopped

    if options.all and options.fraction is not None:
        raise SurgsimError("--all runs every run again: leave --fraction out")
    fraction = 1.0 if options.all else FRACTION if options.fraction is None else options.fraction
    check_fraction(fraction)
    tolerance = TOLERANCE if options.tolerance is None else options.tolerance
    if not 0.0 <= tolerance < 1.0:
        raise SurgsimError(f"--tolerance: {tolerance:g} is not allowed: must be 0 or more, and less than 1")
    if options.sample is not None and options.sample < 0:
        raise SurgsimError(f"--sample: {options.sample} is not allowed: must be 0 or more")
    effort = Effort(
        fraction=fraction,
        sample=secrets.randbits(32) if options.sample is None else options.sample,
        tolerance=tolerance,
        jobs=workers_for(options.jobs),
    )
    bundle = read_bundle(options.bundle)
    protocol = protocol_for(bundle) if options.protocol is None else load_protocol(options.protocol)
    try:
        with redirect_stdout(sys.stderr), show_batch_progress("verify") as report:
            found = verify(bundle, protocol, effort, report)
    except Stopped as stopped:
        print_prose(f"surgsim: {stopped.told}; nothing is kept, verify again", sys.stderr)
        return stopped.exit_status
    if options.json:
        _print_json(bundle, found)
    else:
        _print(bundle, found)
    return 0 if found.verified else 1


def _print(bundle: "Bundle", found: "Verification") -> None:
    from surgsim.cli.findings import print_findings
    from surgsim.cli.table import print_prose
    from surgsim.display import count
    from surgsim.protocol.verify import escape

    score, again, total = bundle.score, len(found.again), found.total
    print_prose(f"{score.controller.name}, {score.protocol}, track {score.track}, {', '.join(score.arms)}")
    print_findings(found.findings)
    if found.platform:
        print_prose(f"another platform: {'; '.join(each.line for each in found.platform)}")
    if not found.verified:
        which = f"{again} of {count(total, 'run')} run again (sample {found.effort.sample})"
        done = which if again else "no run was done again"
        print_prose(f"DIFFERS: {count(len(found.findings), 'difference')}, {done}.")
        return
    how = "bit for bit" if found.exact == again else f"within {found.effort.tolerance:g} of what matters"
    which = f"{again} of {count(total, 'run')} run again (sample {found.effort.sample})"
    print_prose(f"VERIFIED: {which}, the same {how}.")
    if again < total:
        tenth = max(1, total // 10)
        print_prose(
            f"A bundle with {count(tenth, 'altered run')} would escape with a chance of "
            f"{100 * escape(total, again, tenth):.0f} %; --all leaves none."
        )


def _print_json(bundle: "Bundle", found: "Verification") -> None:
    import json
    from dataclasses import asdict

    print(
        json.dumps(
            {
                "verified": found.verified,
                "findings": [asdict(each) for each in found.findings],
                "platform": [asdict(each) for each in found.platform],
                "runs": found.total,
                "run_again": list(found.again),
                "same_bits": found.exact,
                "sample": found.effort.sample,
                "fraction": found.effort.fraction,
                "tolerance": found.effort.tolerance if found.platform else 0.0,
                "scorecard_sha256": bundle.score.scorecard_sha256,
            },
            indent=2,
        )
    )
