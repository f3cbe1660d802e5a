"""`surgsim bench`."""

import argparse

HELP = "measure the speed of simulation and controllers on this machine"
EXAMPLES = """Times are noisy: compare figures of one run only.

examples:
  surgsim bench
  surgsim bench --duration 5 --repeat 3 --json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("--duration", type=float, default=5.0, metavar="S", help="simulated time of a run")
    parser.add_argument("--repeat", type=int, default=3, metavar="N", help="runs of each, the best counts")
    parser.add_argument("--json", action="store_true", help="print JSON")


def execute(options: argparse.Namespace) -> int:
    """Print real-time factors of every shipped controller on the circle."""
    import json

    from surgsim.cli.output import format_number
    from surgsim.cli.table import print_table
    from surgsim.runs.bench import bench

    rows = bench(options.duration, options.repeat)
    if options.json:
        print(json.dumps(rows, indent=2))
        return 0
    names = list(rows[0])
    table = [[row["controller"], *(format_number(row[name]) for name in names[1:])] for row in rows]
    print_table("circle_lwr4plus, one core", names, table, right=range(1, len(names)))
    return 0
