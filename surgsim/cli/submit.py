"""`surgsim submit`."""

import argparse
import sys
from pathlib import Path

from surgsim.cli.paths import path_argument
from surgsim.cli.scenario_options import add_external

HELP = "make a bundle of a score, which others can verify"
EXAMPLES = """A bundle is one archive: scorecard, a row for each run, and hashes of code, assets, packages,
weights, environment and scenarios. The same score gives the same bytes. What would not be verified is not
written, and every reason is told.

examples:
  surgsim submit runs/scores/surgsim_v1/port_tracked/rcm_inverse_dynamics --out mine.zip
  surgsim submit scores/mine --protocol my_protocol.yaml --out mine.zip
  surgsim submit scores/mine --external mine='python my_controller.py' --out mine.zip
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("score", type=path_argument, metavar="SCORE_DIR", help="folder of the score")
    parser.add_argument("--out", type=path_argument, metavar="FILE", help="default: SCORE_DIR.zip")
    parser.add_argument(
        "--protocol", metavar="FILE", help="file of the score's protocol, if it is no shipped one"
    )
    add_external(parser)
    parser.add_argument("--force", action="store_true", help="write over a file that is there")
    parser.add_argument("--json", action="store_true", help="print JSON")


def execute(options: argparse.Namespace) -> int:
    """Write the bundle; 1 if it would not be verified."""
    import hashlib
    import json

    from surgsim.cli.findings import print_findings
    from surgsim.cli.table import print_prose
    from surgsim.errors import SurgsimError
    from surgsim.protocol.definition import load_protocol
    from surgsim.protocol.submit import submission, write_archive

    out: Path = options.out or options.score.resolve().with_suffix(".zip")
    if out.exists() and not options.force:
        raise SurgsimError(f"{out} is there already; give --force to write over it, or another --out")
    protocol = None if options.protocol is None else load_protocol(options.protocol)
    made = submission(options.score, protocol)
    if made.findings:
        print_findings(made.findings)
        text = f"surgsim: {options.score}: no bundle was written: score again with the code that is here"
        print_prose(text, sys.stderr)
        return 1
    write_archive(out, made.archive)
    sha256 = hashlib.sha256(made.archive).hexdigest()
    score = made.bundle.score
    if options.json:
        told = {
            "bundle": str(out),
            "sha256": sha256,
            "bytes": len(made.archive),
            "runs": len(made.bundle.rows),
        }
        print(json.dumps({**told, "scorecard_sha256": score.scorecard_sha256}, indent=2))
        return 0
    print_prose(
        f"{score.controller.name}, {score.protocol}, track {score.track}, {', '.join(score.arms)}: "
        f"{len(made.bundle.rows)} runs"
    )
    print(f"scorecard {score.scorecard_sha256}")
    print(f"bundle    {sha256}")
    print_prose(f"wrote {out} ({max(1, len(made.archive) // 1024)} kB)", sys.stderr)
    return 0
