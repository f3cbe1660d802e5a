"""Options that commands on scenarios share."""

import argparse
from collections.abc import Iterator
from contextlib import contextmanager

from surgsim.errors import ScenarioError, SurgsimError


def add_scenario_options(parser: argparse.ArgumentParser) -> None:
    """`--controller`, `--set`, `--seed` and `--external`."""
    parser.add_argument("--controller", metavar="NAME", help="controller instead of the scenario's own")
    add_settings(parser, "change one value; may be given again")
    parser.add_argument("--seed", type=int, metavar="N", help="seed instead of the scenario's own")
    add_external(parser)


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


def add_external(parser: argparse.ArgumentParser) -> None:
    """`--external`."""
    parser.add_argument(
        "--external",
        action="append",
        default=[],
        metavar="NAME=COMMAND",
        dest="externals",
        help="the program, or library.so:function, of an external controller; may be given again",
    )


@contextmanager
def externals_given(options: argparse.Namespace) -> Iterator[None]:
    """Within the block, external controllers have the commands of command line and user's own file.

    Raises:
        SurgsimError: If a command cannot be read.
    """
    texts: list[str] | None = getattr(options, "externals", None)
    if texts is None:  # a command that runs none
        yield
        return
    from surgsim.control.external.given_commands import parse_given
    from surgsim.scenario.externals import externals_given as given

    with given(parse_given(texts)):
        yield


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
