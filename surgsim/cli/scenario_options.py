"""Options that commands on scenarios share."""

import argparse

from surgsim.errors import ScenarioError, SurgsimError


def add_scenario_options(parser: argparse.ArgumentParser) -> None:
    """`--controller`, `--set` and `--seed`."""
    parser.add_argument("--controller", metavar="NAME", help="controller instead of the scenario's own")
    add_settings(parser, "change one value; may be given again")
    parser.add_argument("--seed", type=int, metavar="N", help="seed instead of the scenario's own")


def add_settings(parser: argparse.ArgumentParser, text: str) -> None:
    """`--set`."""
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY.PATH=VALUE",
        dest="assignments",
        help=text,
    )


def add_matters(parser: argparse.ArgumentParser) -> None:
    """`--matters`."""
    parser.add_argument(
        "--matters",
        action="append",
        default=[],
        metavar="METRIC=VALUE",
        help="smallest difference that matters",
    )


def naming_file(name: str, error: SurgsimError) -> SurgsimError:
    """`error` with the scenario as it was given, where it names only what the scenario calls itself."""
    if isinstance(error, ScenarioError) or str(error).startswith(f"{name}: "):
        return error
    return type(error)(f"{name}: {error}")
