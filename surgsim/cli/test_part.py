"""`surgsim test-part`."""

import argparse
import json

HELP = "test the parts that another package adds"
EXAMPLES = """Runs the checks that every shipped part passes on the resolvers, torque laws, port and
instrument estimators, tasks, disturbances, props, plants, bilateral schemes, policies, robots, instruments
and metrics of an installed package. Exit status: 0 all promises hold, 1 one is broken, 2 there is no such
package.

examples:
  surgsim test-part mylab-resolvers
  surgsim test-part mylab-resolvers --json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("package", metavar="PACKAGE", help="name of the installed distribution")
    parser.add_argument("--json", action="store_true", help="print JSON")


def execute(options: argparse.Namespace) -> int:
    """Print a row a part and check; 1 if a promise is broken."""
    from dataclasses import asdict

    from surgsim.cli.table import print_table
    from surgsim.contract.package import check_package
    from surgsim.display import count

    results = check_package(options.package)
    broken = [result for result in results if not result.passed]
    if options.json:
        print(json.dumps([asdict(result) for result in results], indent=2))
    else:
        rows = [(f"{r.kind} {r.part}", r.check, r.detail if not r.passed else "holds") for r in results]
        parts = len({(r.kind, r.part) for r in results})
        counted = f"{count(parts, 'part')}, {count(len(results), 'check')}"
        title = f"{options.package}: {counted}, {len(broken) or 'none'} broken"
        print_table(title, ("part", "promise", "result"), rows)
    return 1 if broken else 0
