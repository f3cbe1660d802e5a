"""Builds a tree from YAML parser events, refusing all that a scenario does not need.

Nothing is constructed that was not checked: the nesting is bounded before a value is built, and plain
scalars are resolved here by the core schema of YAML 1.2.
"""

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, NoReturn

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from surgsim.errors import ScenarioError
from surgsim.scenario.messages import dotted, one_line, show

KeyPath = tuple[str | int, ...]

MAX_BYTES = 256 * 1024
MAX_DEPTH = 16

_NULLS = {"", "~", "null", "Null", "NULL"}
_BOOLS = {"true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False}
_INTEGER = re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_FORBIDDEN = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufeff\ufffe\uffff]")


def locate(source: str, place: int | str, path: KeyPath = ()) -> str:
    """`file:line: key.path`, with the `--set` option in place of file and line where it gave the value."""
    head = place if isinstance(place, str) else f"{one_line(source, 200)}:{place}"
    return f"{head}: {dotted(path)}" if path else head


def _events(text: str, fail: Callable[..., NoReturn]) -> Iterator[Any]:
    """Parser events, with every complaint of the parser turned into a `ScenarioError`."""
    try:
        yield from YAML(typ="safe", pure=True).parse(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        reason = ", ".join(filter(None, (error.context, error.problem)))
        fail(mark.line + 1 if mark else 1, (), f"is not valid YAML: {one_line(reason, 200)}", error)
    except (YAMLError, ValueError, OverflowError) as error:  # the latter: \U escapes beyond Unicode
        fail(1, (), f"is not valid YAML: {one_line(str(error), 200)}", error)


@dataclass
class TreeBuilder:
    """Builds the tree of one text from the parser's events."""

    text: str
    source: str
    label: str | None = None
    lines: dict[KeyPath, int | str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the size and the characters before the parser sees the text."""
        if len(self.text.encode("utf-8", "surrogatepass")) > MAX_BYTES:
            self.fail(1, (), f"is larger than {MAX_BYTES // 1024} KiB")
        if found := _FORBIDDEN.search(self.text):
            line = self.text.count("\n", 0, found.start()) + 1
            self.fail(line, (), f"has a control or invalid character: {show(found.group())}")
        self.events = _events(self.text, self.fail)

    def fail(self, line: int, path: KeyPath, reason: str, cause: Exception | None = None) -> NoReturn:
        """Raise the `ScenarioError` for what stands at `path`."""
        raise ScenarioError(locate(self.source, self.label or line, path), reason) from cause

    def _mark(self, event: Any, path: KeyPath) -> int:
        line: int = event.start_mark.line + 1
        self.lines[path] = self.label or line
        return line

    def document(self) -> Any:
        """The one document of a file."""
        kind, first = self._next_kind()
        if kind == "StreamEnd":
            self.fail(1, (), "the file is empty")
        if first.version or first.tags:
            self.fail(first.start_mark.line + 1, (), "directives (%) are not allowed")
        tree = self._node(*self._next_kind(), ())
        self._next_kind()
        kind, event = self._next_kind()
        if kind != "StreamEnd":
            self.fail(event.start_mark.line + 1, (), "a second document starts here: one is allowed")
        return tree

    def value(self, path: KeyPath) -> Any:
        """The one scalar or flow value of a `--set`."""
        if len(self.text.splitlines()) > 1:
            self.fail(1, (), "the value must be on one line")
        kind, event = self._next_kind()
        if kind == "StreamEnd":
            self.fail(1, (), "no value given; write null for none")
        kind, first = self._next_kind()
        is_block = getattr(first, "flow_style", None) is False or getattr(first, "style", None) in ("|", ">")
        if event.explicit or is_block:
            self.fail(1, (), "the value must be a scalar, a [list] or a {key: value} mapping")
        tree = self._node(kind, first, path)
        rest = self.text[self.last.end_mark.index :].strip()
        self._next_kind()
        if rest:
            self.fail(1, (), f"nothing may follow the value: {show(rest)}; use quotes")
        return tree

    def _next_kind(self) -> tuple[str, Any]:
        self.last = event = next(self.events)
        kind = type(event).__name__.removesuffix("Event")
        return self._next_kind() if kind == "StreamStart" else (kind, event)

    def _node(self, kind: str, event: Any, path: KeyPath) -> Any:
        line = self._mark(event, path) if path not in self.lines else event.start_mark.line + 1
        if kind == "Alias" or event.anchor is not None:
            self.fail(line, path, "anchors (&) and aliases (*) are not allowed; quote such a text")
        if event.tag is not None:
            self.fail(line, path, f"tags (!) are not allowed: {show(event.tag)}; quote such a text")
        if kind == "Scalar":
            return self._scalar(event, line, path)
        if len(path) >= MAX_DEPTH:
            self.fail(line, (), f"nested deeper than {MAX_DEPTH} levels")
        return self._mapping(path) if kind == "MappingStart" else self._sequence(path)

    def _mapping(self, path: KeyPath) -> dict[str, Any]:
        tree: dict[str, Any] = {}
        while (pair := self._next_kind())[0] != "MappingEnd":
            key = self._key(*pair, path, tree)
            tree[key] = self._node(*self._next_kind(), (*path, key))
        return tree

    def _sequence(self, path: KeyPath) -> list[Any]:
        tree: list[Any] = []
        while (pair := self._next_kind())[0] != "SequenceEnd":
            tree.append(self._node(*pair, (*path, len(tree))))
        return tree

    def _key(self, kind: str, event: Any, path: KeyPath, taken: dict[str, Any]) -> str:
        line = event.start_mark.line + 1
        if kind != "Scalar" or event.anchor is not None or event.tag is not None:
            self.fail(line, path, "a key must be a plain string")
        if event.value == "<<" and event.style is None:
            self.fail(line, path, "merge keys (<<) are not allowed")
        key = self._scalar(event, line, path)
        if not isinstance(key, str) or not key or not key.isprintable():
            self.fail(line, path, f"a key must be a string of printable characters: {show(key)}")
        if key in taken:
            self.fail(line, (*path, key), f"duplicate key, first given on line {self.lines[*path, key]}")
        self._mark(event, (*path, key))
        return key

    def _scalar(self, event: Any, line: int, path: KeyPath) -> Any:
        text: str = event.value
        if found := _FORBIDDEN.search(text):
            self.fail(line, path, f"has a control or invalid character: {show(found.group())}")
        try:
            return _resolve(text) if event.style is None else text
        except ValueError as error:
            self.fail(line, path, str(error), error)


def _resolve(text: str) -> Any:
    """Value of a plain scalar by the core schema of YAML 1.2 (section 10.3)."""
    if text in _NULLS:
        return None
    if text in _BOOLS:
        return _BOOLS[text]
    if _INTEGER.fullmatch(text):
        base = {"0o": 8, "0x": 16}.get(text[:2], 10)
        number = int(text, base) if len(text) < 40 else math.inf
        if abs(number) >= 2**63:
            raise ValueError(f"{one_line(text)} is out of range: an integer has at most 63 bits")
        return number
    if _NOT_FINITE.fullmatch(text):
        raise ValueError(f"{text} is not a finite number")
    if not _FLOAT.fullmatch(text):
        return text
    value = float(text)
    if math.isinf(value) or (value == 0 and re.search("[1-9]", text.lower().partition("e")[0])):
        raise ValueError(f"{one_line(text)} is out of range of a double-precision number")
    return value
