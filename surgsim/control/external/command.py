"""What a command is: a program with its arguments, or a function of a shared library."""

import os
import re
import shlex
from dataclasses import dataclass
from pathlib import Path

from surgsim.errors import SurgsimError

_FUNCTION = re.compile(r"(?P<file>(?:[^\s]|\\ )+\.(?:so(?:\.\d+)*|dylib|dll)):(?P<name>[A-Za-z_]\w*)")


@dataclass(frozen=True, kw_only=True)
class Program:
    """A program and its arguments."""

    words: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Function:
    """A function of a shared library."""

    file: Path
    name: str


def read_command(name: str, text: str) -> Program | Function:
    """What `text`, given for the external controller `name`, means; it is split as a shell splits words.

    No shell runs it: no variable but a leading `~` is replaced, and there are no pipes.

    Raises:
        SurgsimError: If it cannot be split, or is empty.
    """
    found = _FUNCTION.fullmatch(text)
    if found:
        return Function(file=Path(os.path.expanduser(found["file"])).absolute(), name=found["name"])
    try:
        words = shlex.split(text)
    except ValueError as error:
        raise SurgsimError(
            f"external controller '{name}': the command {text!r} cannot be read: {error}"
        ) from error
    if not words:
        raise SurgsimError(f"external controller '{name}': its command is empty")
    return Program(words=(os.path.expanduser(words[0]), *words[1:]))
