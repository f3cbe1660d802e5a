"""What surgsim and an external controller exchange, generated from the records of a tick.

The request of a tick is the record `Seen` of `surgsim.tick.arrays` with room for `MOST_JOINTS` joints,
whatever the arm has: so there is one layout for all arms. Its fields, their order and their words are those
of that class: a field that a controller's part gets there, an external controller gets too. All numbers are
little-endian, of 8 bytes, without gaps.
"""

import hashlib
import inspect
import json
import re
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import cache
from typing import Any, get_type_hints

import numpy as np

from surgsim.tick.arrays import MOST_JOINTS, Record, Seen, layout

VERSION = 1
"""Of the protocol: what is said when. The layout itself has a hash."""
JOINT_VELOCITY, JOINT_TORQUE = 1, 2
"""What an answer is."""
HELLO, DECLARATION, REQUEST, REPLY = (
    int.from_bytes(word, "little") for word in (b"SRGhello", b"SRGdecl\0", b"SRGask\0\0", b"SRGreply")
)
"""Each message begins with one of these."""
TEXT = 64
"""Bytes of a name or version, its end filled with zeros."""


@dataclass(frozen=True, kw_only=True)
class Field:
    """A field of a message.

    Attributes:
        name: Its name.
        type: `f8`, a double; `i8`, a whole number; or `S64`, a text.
        shape: Entries, row by row; () for one number. Where a joint counts there is room for 8.
        shown: The same shape for the arm's n joints, as words: `3 n`.
        unit: Its unit; empty for a number without one.
        meaning: What it is.
    """

    name: str
    type: str
    shape: tuple[int, ...] = ()
    shown: str = ""
    unit: str = ""
    meaning: str = ""


@dataclass(frozen=True, kw_only=True)
class Message:
    """A message: its name, its purpose and its fields in order."""

    name: str
    meaning: str
    fields: tuple[Field, ...]

    @property
    def dtype(self) -> np.dtype[Any]:
        """Its layout."""
        kinds = {"f8": "<f8", "i8": "<i8", f"S{TEXT}": f"S{TEXT}"}
        return np.dtype([(field.name, kinds[field.type], field.shape) for field in self.fields])


def _whole(name: str, meaning: str) -> Field:
    return Field(name=name, type="i8", meaning=meaning)


@cache
def request() -> Message:
    """The request of a tick."""
    head = (
        _whole("magic", "SURGSIM_REQUEST"),
        _whole("tick", "number of the request since `first` was 1, from 1 on; the reply repeats it"),
        _whole("n", "joints of the arm; of arrays over joints, the entries from n on are 0"),
    )
    meaning = "What a controller sees at a tick, and asks for; the fields are those of surgsim's own parts."
    return Message(name="request", meaning=meaning, fields=(*head, *_seen_fields()))


@cache
def reply() -> Message:
    """The answer of a process to a request."""
    fields = (
        _whole("magic", "SURGSIM_REPLY"),
        _whole("tick", "of the request"),
        _whole("status", "0; or 1 where there is no command that meets the constraints"),
        Field(
            name="answer",
            type="f8",
            shape=(MOST_JOINTS,),
            shown="n",
            unit="rad/s or N m",
            meaning="joint velocities or joint torques, as the hello asked for",
        ),
    )
    return Message(name="reply", meaning="What a process answers to a request.", fields=fields)


@cache
def hello() -> Message:
    """What a process is told first; `text_bytes` of JSON follow it."""
    fields = (
        _whole("magic", "SURGSIM_HELLO"),
        _whole("version", "SURGSIM_VERSION"),
        _whole("hash", "SURGSIM_HASH, of the layout of request and reply"),
        _whole("request_bytes", "size of a request"),
        _whole("reply_bytes", "size of a reply"),
        _whole("n", "joints of the arm"),
        _whole("gives", "SURGSIM_JOINT_VELOCITY or SURGSIM_JOINT_TORQUE: what is to be answered"),
        _whole("text_bytes", "length of the JSON text that follows: the arm"),
    )
    return Message(name="hello", meaning="Once, at the beginning; a JSON text follows.", fields=fields)


@cache
def declaration() -> Message:
    """What an external controller answers to the hello."""
    fields = (
        _whole("magic", "SURGSIM_DECLARATION"),
        _whole("version", "SURGSIM_VERSION as it was compiled with"),
        _whole("hash", "SURGSIM_HASH as it was compiled with"),
        _whole("memory", "doubles that a function wants to keep from tick to tick; 0 for a process"),
        Field(name="name", type=f"S{TEXT}", meaning="what the controller is called"),
        Field(name="release", type=f"S{TEXT}", meaning="its version; both go into the results of a run"),
    )
    return Message(name="declaration", meaning="The answer to the hello.", fields=fields)


def messages() -> tuple[Message, ...]:
    """All messages, in the order of a run."""
    return hello(), declaration(), request(), reply()


@cache
def layout_hash() -> int:
    """Hash of version, names, types and shapes of request and reply, as a whole number of 8 bytes."""
    told = [VERSION, [[_plain(field) for field in one.fields] for one in (request(), reply())]]
    digest = hashlib.sha256(json.dumps(told, sort_keys=True).encode()).digest()
    return int.from_bytes(digest[:8], "little", signed=True)


def _plain(field: Field) -> dict[str, Any]:
    told = asdict(field)
    return {key: told[key] for key in ("name", "type", "shape")}


@cache
def runs(n: int) -> tuple[tuple[int, int, int], ...]:
    """Which words of `Seen` go where in a request: (from, to, how many), for an arm of `n` joints."""
    source, target = layout(Seen, n), request().dtype
    assert source.fields is not None
    assert target.fields is not None
    found: list[tuple[int, int, int]] = []
    for field in _seen_fields():
        at, to = source.fields[field.name][1] // 8, target.fields[field.name][1] // 8
        own = source.fields[field.name][0].shape
        columns, wide = (own[-1], field.shape[-1]) if own else (1, 1)
        for row in range(int(np.prod(own[:-1])) if own else 1):
            _add(found, at + row * columns, to + row * wide, columns)
    return tuple(found)


def _add(found: list[tuple[int, int, int]], at: int, to: int, count: int) -> None:
    """Add a run, to the last one where it follows that."""
    if found and found[-1][0] + found[-1][2] == at and found[-1][1] + found[-1][2] == to:
        before = found.pop()
        at, to, count = before[0], before[1], before[2] + count
    found.append((at, to, count))


@cache
def _seen_fields() -> tuple[Field, ...]:
    """The numbers and arrays of `Seen`, with what its docstring says of them."""
    said, fields = dict(_said(Seen)), []
    for name, hint in get_type_hints(Seen).items():
        if name not in Seen.SHAPES and hint not in (int, float):
            continue  # a record, or what the class says of itself
        shown = Seen.SHAPES.get(name, "")
        shape = tuple(MOST_JOINTS if size == "n" else int(size) for size in shown.split())
        unit, meaning = said.get(name, ("", ""))
        kind = "i8" if hint is int else "f8"
        fields.append(Field(name=name, type=kind, shape=shape, shown=shown, unit=unit, meaning=meaning))
    return tuple(fields)


def _said(kind: type[Record]) -> Iterator[tuple[str, tuple[str, str]]]:
    """Unit and meaning of each attribute, from the class's docstring; nothing where Python drops those."""
    text = inspect.getdoc(kind) or ""
    for name, told in re.findall(r"^    (\w+): (.+(?:\n {8,}.+)*)", text, re.M):
        line = " ".join(told.split()).rstrip(".")
        units = re.findall(r"\[([^\]]+)\]", line)
        yield name, (units[0] if units else "", re.sub(r" *(\(\w+,( \w+)?\)|\[[^\]]+\])", "", line))
