"""The user's own file of commands of external controllers: `surgsim/external.yaml`.

It is in `$XDG_CONFIG_HOME`, or `~/.config`. No scenario holds a command: whoever runs another's
scenario runs no program of theirs.
"""

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from surgsim.control.external.given_commands import asking_for, giving, parse_given
from surgsim.errors import SurgsimError
from surgsim.scenario.yaml_text import read_yaml


@contextmanager
def externals_given(commands: Mapping[str, str]) -> Iterator[None]:
    """Within the block, external controllers have these commands, and others those of the user's own file.

    Runs that name none of these are refused by `surgsim.runs.part_origins.check_parts`.

    Raises:
        SurgsimError: If a name is none, or that file is not right.
    """
    named = parse_given([f"{name}={command}" for name, command in commands.items()], "external controllers")
    with giving({**configured(), **named}), asking_for(named):
        yield


def config_file() -> Path:
    """Where the file would be."""
    given = os.environ.get("XDG_CONFIG_HOME", "")
    folder = given if os.path.isabs(given) else os.path.expanduser("~/.config")
    return Path(folder) / "surgsim" / "external.yaml"


def configured() -> dict[str, str]:
    """Commands by name, of the user's own file; none where there is no such file.

    Raises:
        SurgsimError: If the file is no mapping of names to commands.
    """
    file = config_file()
    if not os.path.isfile(file):  # also where its folder may not be looked into
        return {}
    tree = read_yaml(file).tree
    for name, command in tree.items():
        if not isinstance(command, str):
            raise SurgsimError(f"{file}: {name}: {str(command)[:60]!r} is no command: write NAME: COMMAND")
    return parse_given((f"{name}={command}" for name, command in tree.items()), str(file))
