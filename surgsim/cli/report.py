"""`surgsim report`."""

import argparse

from surgsim.cli.paths import path_argument
from surgsim.cli.scenario_options import add_matters

HELP = "write one HTML page about a batch"
EXAMPLES = """The page needs nothing but itself: it opens from disk, offline, on a phone and in print. Its
links lead to the runs' folders and recordings, relative to where the page is.

examples:
  surgsim report runs/suites/quick
  surgsim report runs/suites/quick --out quick.html
  surgsim report runs/suites/quick --matters rcm_error_rms_mm=0.5
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("folder", type=path_argument, metavar="DIR", help="results folder of surgsim compare")
    parser.add_argument(
        "--out", type=path_argument, metavar="FILE", help="file to write; default DIR/report.html"
    )
    add_matters(parser)
    parser.add_argument("--json", action="store_true", help="print JSON")


def execute(options: argparse.Namespace) -> int:
    """Write the page and print where it is."""
    import json
    import sys

    from surgsim.compare.matters import parse_matters
    from surgsim.report.write import write_report

    matters = parse_matters(options.matters)
    file = write_report(options.folder, options.out, lambda text: print(text, file=sys.stderr), matters)
    size = file.stat().st_size
    if options.json:
        print(json.dumps({"report": str(file), "bytes": size}))
    else:
        print(f"{file}  {size / 1024:.0f} KiB")
    return 0
