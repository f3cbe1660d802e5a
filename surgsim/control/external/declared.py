"""What external controllers say of themselves, remembered for a run's provenance."""

from dataclasses import dataclass

import numpy as np

from surgsim.control.external.layout import DECLARATION, VERSION, declaration, layout_hash
from surgsim.errors import SurgsimError

MOST_MEMORY = 1_000_000


@dataclass(frozen=True, kw_only=True)
class Declared:
    """What an external controller says of itself.

    Attributes:
        name: What it is called.
        release: Its version.
        memory: Doubles that a function keeps from tick to tick.
    """

    name: str
    release: str
    memory: int = 0


_last: dict[str, Declared] = {}


def remember(command: str, declared: Declared) -> None:
    """Keep what was declared by `command`, the last time that it was asked."""
    _last[command] = declared


def last_declared(command: str) -> Declared | None:
    """What was declared by `command` the last time in this process; None if it was not asked."""
    return _last.get(command)


def read_declaration(content: bytes, who: str) -> Declared:
    """What the bytes of a declaration say; `who` is what messages call the controller.

    Raises:
        SurgsimError: If they are none, or of another version or layout.
    """
    told = np.frombuffer(content, declaration().dtype)[0]
    if told["magic"] != DECLARATION:
        raise SurgsimError(f"{who} is no controller: it began with {content[:40]!r}, not with a declaration")
    if told["version"] != VERSION:
        raise SurgsimError(f"{who} speaks version {told['version']} of the protocol, not {VERSION}")
    if told["hash"] != layout_hash():
        raise SurgsimError(
            f"{who} was made for another layout of messages, {int(told['hash']):#x} not {layout_hash():#x}: "
            "compile it with the header of `surgsim external header`"
        )
    if not 0 <= told["memory"] <= MOST_MEMORY:
        raise SurgsimError(
            f"{who} wants {told['memory']} doubles of memory; at most {MOST_MEMORY} are allowed"
        )
    name, release = (_text(bytes(told[key]), key, who) for key in ("name", "release"))
    return Declared(name=name, release=release, memory=int(told["memory"]))


def _text(content: bytes, key: str, who: str) -> str:
    try:
        text = content.rstrip(b"\0").decode()
    except UnicodeDecodeError as error:
        raise SurgsimError(f"{who} declares a {key} that is no text: {content[:40]!r}") from error
    if not text or not text.isprintable():
        raise SurgsimError(f"{who} declares the {key} {text!r}: it must be a word or a few")
    return text
