"""Which command stands for an external controller's name: given for a block, never by a scenario."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar

from surgsim.catalog import check_name
from surgsim.errors import SurgsimError, unknown_name

_NONE: Mapping[str, str] = {}
_given: ContextVar[Mapping[str, str]] = ContextVar("given", default=_NONE)
_asked_for: ContextVar[frozenset[str]] = ContextVar("asked_for", default=frozenset())


def given() -> tuple[tuple[str, str], ...]:
    """Names and commands that are given here, as another process can be given them."""
    return tuple(sorted(_given.get().items()))


@contextmanager
def asking_for(names: Iterable[str]) -> Iterator[None]:
    """Within the block, runs have to name each of these external controllers."""
    token = _asked_for.set(frozenset(names))
    try:
        yield
    finally:
        _asked_for.reset(token)


def check_named(named: Iterable[str]) -> None:
    """Refuse runs that name these external controllers, if one has no command or another was asked for.

    Raises:
        SurgsimError: For the first.
    """
    used = sorted(set(named))
    for name in used:
        command_for(name)
    if idle := sorted(_asked_for.get().difference(used)):
        known = f"they name {', '.join(used)}" if used else "give --controller external_torque, for instance"
        raise SurgsimError(f"--external {idle[0]}: no controller of these runs names it; {known}")


@contextmanager
def giving(commands: Mapping[str, str]) -> Iterator[None]:
    """Within the block, controllers that are built find these commands under their names."""
    token = _given.set({**_given.get(), **commands})
    try:
        yield
    finally:
        _given.reset(token)


def command_for(name: str) -> str:
    """The command of the external controller `name`.

    Raises:
        SurgsimError: If none is given.
    """
    commands = _given.get()
    if name in commands:
        return commands[name]
    how = (
        f"give --external {name}=COMMAND, or the line '{name}: COMMAND' in surgsim/external.yaml of ~/.config"
    )
    known = f" {unknown_name(name, 'given one', commands)}" if commands else ""
    raise SurgsimError(f"external controller '{name}' has no command: {how}.{known}")


def parse_given(texts: Iterable[str], where: str = "--external") -> dict[str, str]:
    """Commands by name, of texts `NAME=COMMAND`.

    Raises:
        SurgsimError: If one is not of this form, or a name stands twice.
    """
    found: dict[str, str] = {}
    for text in texts:
        name, sign, command = (part.strip() for part in text.partition("="))
        if not sign or not command:
            raise SurgsimError(f"{where}: '{text[:60]}' is not NAME=COMMAND")
        try:
            check_name(name)
        except ValueError as error:
            raise SurgsimError(f"{where}: the name {error}") from error
        if name in found:
            raise SurgsimError(f"{where}: '{name}' is given twice")
        found[name] = command
    return found
