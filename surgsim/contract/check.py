"""A check of a part, and what came of it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


class BrokenPromiseError(Exception):
    """A part does not do what its kind promises; the message says what it did."""


def require(holds: object, text: str) -> None:
    """Raise BrokenPromiseError with `text` unless `holds`."""
    if not holds:
        raise BrokenPromiseError(text)


@dataclass(frozen=True, kw_only=True)
class Check:
    """One promise.

    Attributes:
        name: What the table calls it.
        run: Raises if the part, given as its config class (of a policy: as itself), breaks the promise.
    """

    name: str
    run: Callable[[Any], None]


@dataclass(frozen=True, kw_only=True)
class Result:
    """What came of one check of one part.

    Attributes:
        kind: Of the part, e.g. `resolver`.
        part: Its name.
        check: Name of the check.
        passed: Whether the promise holds.
        detail: What happened otherwise.
    """

    kind: str
    part: str
    check: str
    passed: bool
    detail: str = ""
