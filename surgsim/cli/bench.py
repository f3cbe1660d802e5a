"""`surgsim bench`."""

import argparse

HELP = "measure the speed of simulation and controllers on this machine"
EXAMPLES = """ratio: a tick over the bare mj_steps of its period, measured in turn in one thread.

examples:
  surgsim bench
  surgsim bench --duration 5 --repeat 3 --json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("--duration", type=float, default=5.0, metavar="S", help="simulated time of a run")
    parser.add_argument("--repeat", type=int, default=3, metavar="N", help="runs of each, all chunks count")
    parser.add_argument("--json", action="store_true", help="print JSON")


def execute(options: argparse.Namespace) -> int:
    """Print what a tick costs beside a bare step, for every shipped controller."""
    import json

    from surgsim.cli.table import print_table
    from surgsim.display import number
    from surgsim.runs.bench import bench

    rows = bench(options.duration, options.repeat)
    if options.json:
        print(json.dumps(rows, indent=2))
        return 0
    names = list(rows[0])
    table = [[row["run"], *(number(row[name]) for name in names[1:])] for row in rows]
    print_table(
        "a tick beside bare mj_step of the same model, thread time", names, table, right=range(1, len(names))
    )
    return 0
