"""Scenario text: a small, safe part of YAML 1.2, with the line of every key.

Anchors, aliases, merge keys, tags and directives are refused, as are duplicate keys; size and nesting are
bounded. The tree is built here from the parser's events, so nothing is constructed that was not checked.
"""

import copy
import json
import math
import re
import stat
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from surgsim.errors import ScenarioError
from surgsim.scenario.messages import dotted, one_line, show, show_with_kind
from surgsim.scenario.yaml_events import MAX_BYTES, MAX_DEPTH, KeyPath, TreeBuilder, locate

_PLAIN = re.compile(r"[A-Za-z_/][A-Za-z0-9_./-]*( [A-Za-z0-9_./()-]+)*")
_QUOTED_WORDS = {"y", "n", "yes", "no", "on", "off", "true", "false", "null"}  # words to YAML 1.1 or 1.2


@dataclass(frozen=True)
class YamlDocument:
    """A parsed scenario text.

    Attributes:
        tree: Mappings, lists, strings, finite numbers, booleans and None.
        lines: Line of each key path, counted from 1, or the `--set` option that gave it.
        source: Name of the file.
    """

    tree: dict[str, Any]
    lines: Mapping[KeyPath, int | str]
    source: str

    def where(self, path: KeyPath) -> str:
        """`file:line: key.path` of `path`, or of its nearest existing parent's line."""
        found = next((self.lines[path[:n]] for n in range(len(path), -1, -1) if path[:n] in self.lines), 1)
        return locate(self.source, found, path)


def parse_yaml(text: str, source: str) -> YamlDocument:
    """Parse one YAML document whose top level is a mapping.

    Raises:
        ScenarioError: If the text is not that, or uses what is refused here.
    """
    found = _parsed(text.removeprefix("\ufeff"), source)
    return replace(found, tree=copy.deepcopy(found.tree))


@lru_cache(maxsize=64)
def _parsed(text: str, source: str) -> YamlDocument:
    """The document: a batch reads the same files for every run."""
    builder = TreeBuilder(text, source)
    tree = builder.document()
    if not isinstance(tree, dict):
        builder.fail(1, (), f"the top level is {show_with_kind(tree)}, not a mapping of keys to values")
    return YamlDocument(tree=tree, lines=builder.lines, source=source)


def read_yaml(path: Path) -> YamlDocument:
    """Read and parse a file, see `parse_yaml`.

    Raises:
        ScenarioError: If the file cannot be read or is not UTF-8, or as `parse_yaml`.
    """
    source = one_line(str(path), 200)
    try:
        if not stat.S_ISREG(path.stat().st_mode):  # a pipe or device could block or never end
            raise ScenarioError(source, "is a folder or a device, not a scenario file")
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:  # ValueError: NUL in the path
        reason = getattr(error, "strerror", None) or str(error)
        raise ScenarioError(source, f"cannot be read: {one_line(reason)}") from error
    if len(data) > MAX_BYTES:
        raise ScenarioError(source, f"is larger than {MAX_BYTES // 1024} KiB")
    try:
        text = data.decode()
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        reason = f"is not UTF-8 text: byte 0x{data[error.start]:02x} at offset {error.start}"
        raise ScenarioError(f"{source}:{line}", reason) from error
    return parse_yaml(text, str(path))


def set_value(document: YamlDocument, assignment: str) -> YamlDocument:
    """Apply one `--set key.path=value`; `document` itself is unchanged.

    Items of lists are named by their index from 0. Mappings on the way that are absent are created, so that
    a part left at its default can be changed; the schema then judges their names.

    Raises:
        ScenarioError: If the assignment is malformed or its path leads through something else.
    """
    label = one_line(f"--set {assignment}", 100)
    name, equals, text = assignment.partition("=")
    path: KeyPath = tuple(name.strip().split("."))
    if not equals or not all(path) or not name.isprintable():
        raise ScenarioError(label, "write --set key.path=value")
    tree = copy.deepcopy(document.tree)
    node: Any = tree
    for depth, part in enumerate(path):
        key = _slot(node, path[:depth], str(part), label)
        path = (*path[:depth], key, *path[depth + 1 :])
        if depth < len(path) - 1:
            if isinstance(node, dict) and node.get(key) is None:
                node[key] = {}
            node = node[key]
    value, lines = _value(text, document.source, label, path)
    node[path[-1]] = copy.deepcopy(value)
    kept = {old: line for old, line in document.lines.items() if old[: len(path)] != path}
    made = {path[:n]: label for n in range(1, len(path)) if path[:n] not in kept}
    return YamlDocument(tree=tree, lines={**kept, **made, **lines}, source=document.source)


@lru_cache(maxsize=256)
def _value(text: str, source: str, label: str, path: KeyPath) -> tuple[Any, Mapping[KeyPath, int | str]]:
    """The value that an assignment gives to the key at `path`, and its lines."""
    builder = TreeBuilder(text, source, label)
    return builder.value(path), builder.lines


def _slot(node: Any, path: KeyPath, part: str, label: str) -> str | int:
    """Key or index that `part` means in `node`, which stands at `path`."""
    if len(path) >= MAX_DEPTH:
        raise ScenarioError(label, f"nested deeper than {MAX_DEPTH} levels")
    if isinstance(node, dict):
        return part
    where = f"{label}: {dotted(path)}"
    if not isinstance(node, list):
        raise ScenarioError(where, f"{show_with_kind(node)} has no key '{one_line(part)}'")
    if not re.fullmatch(r"[0-9]{1,6}", part) or int(part) >= len(node):
        allowed = f"0 to {len(node) - 1}" if node else "none, the list is empty"
        raise ScenarioError(where, f"'{one_line(part)}' is not an index of the list. Allowed: {allowed}.")
    return int(part)


def dump_yaml(tree: Mapping[str, Any]) -> str:
    """Write `tree` so that `parse_yaml` gives it back exactly; keys keep their order.

    Raises:
        ValueError: If a number is not finite.
        TypeError: If a value is none of the kinds that `parse_yaml` gives; tuples count as lists.
    """
    return "\n".join(_block(tree, "") if tree else ["{}"]) + "\n"


def _block(node: Any, pad: str) -> list[str]:
    lines: list[str] = []
    pairs = [(f"{_scalar(key)}:", item) for key, item in node.items()] if isinstance(node, Mapping) else []
    for head, item in pairs or [("-", item) for item in node]:
        if not isinstance(item, Mapping | list | tuple) or not _is_deep(item):
            lines.append(f"{pad}{head} {_inline(item)}")
        elif head == "-":
            inner = _block(item, pad + "  ")
            lines += [f"{pad}- {inner[0].removeprefix(pad + '  ')}", *inner[1:]]
        else:
            lines += [f"{pad}{head}", *_block(item, pad + "  ")]
    return lines


def _is_deep(node: Any) -> bool:
    if isinstance(node, Mapping):
        return bool(node)
    return any(isinstance(item, Mapping | list | tuple) for item in node)


def _inline(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_scalar(item) for item in value) + "]"
    return _scalar(value)


def _scalar(value: Any) -> str:
    if value is None or isinstance(value, bool):
        return show(value)
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError(f"{value} cannot be written: it is not finite")
        text = repr(float(value))  # YAML 1.1 readers need a point before the exponent
        return text if "." in text else text.replace("e", ".0e")
    if isinstance(value, int):
        return str(int(value))
    if not isinstance(value, str):
        raise TypeError(f"{type(value).__name__} cannot be written to YAML")
    if _PLAIN.fullmatch(value) and value.lower() not in _QUOTED_WORDS:
        return value
    quoted = json.dumps(value, ensure_ascii=False)
    return "".join(c if c.isprintable() else f"\\U{ord(c):08x}" for c in quoted)
