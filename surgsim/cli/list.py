"""`surgsim list`."""

import argparse
import json
from collections.abc import Callable

HELP = "list what a scenario can name"
EXAMPLES = """examples:
  surgsim list scenarios
  surgsim list resolvers --json
"""

KINDS = (
    "scenarios",
    "suites",
    "controllers",
    "robots",
    "instruments",
    "tasks",
    "resolvers",
    "torque-laws",
    "port-estimators",
    "instrument-estimators",
    "policies",
    "externals",
    "plants",
    "bilateral",
    "disturbances",
    "props",
    "metrics",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("kind", choices=KINDS, metavar="KIND", help=", ".join(KINDS))
    parser.add_argument("--json", action="store_true", help="print JSON")


def execute(options: argparse.Namespace) -> int:
    """Print the names with a line about each."""
    from surgsim.cli.table import print_table

    items = items_of(options.kind)
    if options.json:
        print(json.dumps([{"name": name, "description": text} for name, text in items], indent=2))
    else:
        print_table(f"{len(items)} {options.kind}", ("name", "description"), items)
    return 0


def _described(describe: Callable[[str], str], name: str) -> str:
    """A line about a part, or why there is none."""
    from surgsim.errors import SurgsimError

    try:
        return describe(name)
    except SurgsimError as error:
        return f"cannot be used: {error}"


def items_of(kind: str) -> list[tuple[str, str]]:
    """Names of one of `KINDS`, each with a line about it."""
    if kind in ("scenarios", "suites", "controllers"):
        return _files(kind)
    if kind == "robots":
        from surgsim.models.folders import robot_names
        from surgsim.models.robot import robot_description

        return [(name, _described(robot_description, name)) for name in robot_names()]
    if kind == "instruments":
        from surgsim.models.instrument_files import instrument_description, instrument_names

        return [(name, _described(instrument_description, name)) for name in instrument_names()]
    if kind == "policies":
        from surgsim.control.policies.registry import policy_names, policy_summary

        return [(name, policy_summary(name)) for name in policy_names()]
    if kind == "externals":
        from surgsim.scenario.externals import configured

        return sorted(configured().items())
    if kind == "metrics":
        from surgsim.metrics.catalog import METRICS

        return [(metric.name, metric.meaning) for metric in METRICS.values()]
    from surgsim.control.instrument_estimators import INSTRUMENT_ESTIMATORS
    from surgsim.control.port_estimators import PORT_ESTIMATORS
    from surgsim.control.resolvers import RESOLVERS
    from surgsim.control.torque_laws import TORQUE_LAWS
    from surgsim.plant import PLANTS
    from surgsim.plant.disturbances import DISTURBANCES
    from surgsim.plant.props import PROPS
    from surgsim.tasks import TASKS
    from surgsim.teleop.bilateral import BILATERAL

    catalogs = {
        "tasks": TASKS,
        "resolvers": RESOLVERS,
        "torque-laws": TORQUE_LAWS,
        "port-estimators": PORT_ESTIMATORS,
        "instrument-estimators": INSTRUMENT_ESTIMATORS,
        "plants": PLANTS,
        "bilateral": BILATERAL,
        "disturbances": DISTURBANCES,
        "props": PROPS,
    }
    catalog = catalogs[kind]
    return [(name, catalog.summary(name)) for name in catalog.names()]


def _files(kind: str) -> list[tuple[str, str]]:
    from surgsim.scenario.drawn import drawn_names
    from surgsim.scenario.load import shipped, shipped_safety
    from surgsim.scenario.yaml_text import read_yaml

    files = shipped(kind) if kind != "scenarios" else {**shipped(), **shipped_safety()}
    listed = [(name, str(read_yaml(path).tree.get("description", ""))) for name, path in files.items()]
    return listed if kind != "scenarios" else [*listed, *drawn_names().items()]
