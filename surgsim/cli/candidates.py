"""What can come next on a command line."""

import argparse
from collections.abc import Callable, Iterable, Sequence

Candidate = tuple[str, str]
"""A word, and what it is."""


def candidates(parser: argparse.ArgumentParser, words: Sequence[str]) -> list[Candidate]:
    """Words that can stand in place of the last of `words` and begin as it does; none where only a path can.

    Args:
        parser: The whole command line.
        words: What is typed after the program's name; the last is not finished, and may be empty.
    """
    *before, last = words or [""]
    commands = _commands(parser)
    if not before:
        return _fitting(commands.items(), last)
    if before[0] not in _parsers(parser):
        return []
    command = _parsers(parser)[before[0]]
    options = {name: action for action in command._actions for name in action.option_strings}
    if "=" in last and last.partition("=")[0] in options:
        name, _, begun = last.partition("=")
        return [(f"{name}={word}", about) for word, about in _values(options[name], begun)]
    if before[-1] in options and options[before[-1]].nargs != 0:
        return _values(options[before[-1]], last)
    if last.startswith("-"):
        known = {
            n: a.help or "" for n, a in options.items() if n.startswith("--") and a.help != argparse.SUPPRESS
        }
        return _fitting(known.items(), last)
    return [
        found for action in command._actions if not action.option_strings for found in _values(action, last)
    ]


def _parsers(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """The parser of each command."""
    groups = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    return dict(groups[0].choices)


def _commands(parser: argparse.ArgumentParser) -> dict[str, str]:
    """Each command with its help."""
    return {name: command.description or "" for name, command in _parsers(parser).items()}


def _values(action: argparse.Action, begun: str) -> list[Candidate]:
    """Values of an argument that begin with `begun`."""
    if action.choices is not None:
        return _fitting(((str(choice), "") for choice in action.choices), begun)
    if action.dest not in _NAMES:
        return []
    listed, _, last = begun.rpartition(",") if action.dest in _LISTS else ("", "", begun)
    start = f"{listed}," if listed else ""
    return [(start + name, about) for name, about in _fitting(_NAMES[action.dest](), last)]


def _fitting(known: Iterable[Candidate], begun: str) -> list[Candidate]:
    return [(word, about) for word, about in known if word.startswith(begun)]


def _scenarios() -> list[Candidate]:
    return [*_files(""), *((f"safety/{name}", about) for name, about in _files("safety"))]


def _suites_and_scenarios() -> list[Candidate]:
    return [*_files("suites"), *_scenarios()]


def _controllers() -> list[Candidate]:
    return _files("controllers")


def _files(folder: str) -> list[Candidate]:
    """Names of the shipped files of a folder; nothing is parsed, as a person waits."""
    from surgsim.resources import resource_dir

    return [(path.stem, "") for path in sorted((resource_dir("scenarios") / folder).glob("*.yaml"))]


def _studies() -> list[Candidate]:
    from surgsim.studies import STUDIES

    return [(name, "") for name in STUDIES]


def _shells() -> list[Candidate]:
    from surgsim.cli.completion import SCRIPTS

    return [(name, "") for name in SCRIPTS]


_NAMES: dict[str, Callable[[], list[Candidate]]] = {
    "scenario": _scenarios,
    "scenarios": _scenarios,
    "names": _suites_and_scenarios,
    "controller": _controllers,
    "controllers": _controllers,
    "study": _studies,
    "shell": _shells,
}
_LISTS = ("controllers",)
