"""Freezing a protocol: its hashes are written, and what changed since is refused."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import surgsim
from surgsim.errors import SurgsimError
from surgsim.protocol.definition import CURRENT, Protocol, load_protocol
from surgsim.protocol.items import Items, all_items, items_of, protocol_sha256
from surgsim.protocol.seeds import any_open
from surgsim.recording.files import replacing, write_file
from surgsim.runs.provenance import commit_of
from surgsim.runs.sources import ROOT
from surgsim.scenario.yaml_text import dump_yaml, read_yaml

SCHEMA_VERSION = 1
_SHOWN = 6


def freeze(protocol: Protocol) -> tuple[str, list[str]]:
    """Write the protocol's hashes.

    Returns:
        The hash of all of it, and the names of the items that changed since it was frozen before.

    Raises:
        SurgsimError: If it is no draft any more, or the disk refuses.
    """
    items = all_items(protocol)
    before = _read(protocol)["items"] if protocol.lock.is_file() else {}
    changed = changes(before, items)
    if before and not changed:
        return protocol_sha256(items), []
    if before and (why := _why_final(protocol)):
        raise SurgsimError(
            f"{protocol.name} is frozen for good, {why}: {_named(changed)} changed. "
            f"Give the change a name of its own: surgsim protocol freeze NEW_NAME --from {protocol.name}"
        )
    content = {
        "schema_version": SCHEMA_VERSION,
        "protocol": protocol.name,
        "sha256": protocol_sha256(items),
        "surgsim": surgsim.__version__,
        "commit": commit_of(ROOT.parent),
        "items": items,
    }
    try:
        with replacing(protocol.lock) as draft:
            write_file(draft, json.dumps(content, indent=1) + "\n")
    except OSError as error:
        raise SurgsimError(f"cannot write {protocol.lock}: {error.strerror or error}") from error
    return protocol_sha256(items), changed if before else []


def freeze_as(protocol: Protocol, name: str, folder: Path | None = None) -> tuple[Protocol, str]:
    """Copy the definition under a new name, and freeze it with what the code is now; the old one stays.

    Args:
        protocol: Whose definition is copied.
        name: The new name.
        folder: Where the new one's files go; beside the old one's for None.

    Raises:
        SurgsimError: If the name is taken or not allowed, or the disk refuses.
    """
    path = (folder or protocol.path.parent) / f"{name}.yaml"
    if path.exists():
        raise SurgsimError(f"{path} is there already; freeze it by its own name, or choose another")
    tree: dict[str, Any] = {**read_yaml(protocol.path).tree, "name": name, "draft": True}
    with replacing(path) as draft:
        write_file(draft, dump_yaml(tree))
    try:
        copy = load_protocol(str(path))
        return copy, freeze(copy)[0]
    except SurgsimError:
        path.unlink()
        raise


def check_frozen(protocol: Protocol, track: str, arms: Sequence[str]) -> str:
    """Refuse a protocol of which something changed that a score of this track and these arms follows from.

    Returns:
        The hash of all of the protocol, as it was frozen.

    Raises:
        SurgsimError: If something changed, naming it and the way out; or the protocol is not frozen.
    """
    lock = _read(protocol)
    frozen: Items = lock["items"]
    now = items_of(protocol, protocol.track(track).generators, arms)
    changed = [name for name in sorted(now) if frozen.get(name) != now[name]]
    if not changed:
        return str(lock["sha256"])
    again = (
        f"freeze the draft again (surgsim protocol freeze {protocol.name}), or "
        if not _why_final(protocol)
        else ""
    )
    raise SurgsimError(
        f"{protocol.name} is not what its name says: {_named(changed)} changed since it was frozen. "
        f"Put it back; or {again}give the change a name of its own (surgsim protocol freeze NEW_NAME "
        f"--from {protocol.name}); or score with the release that carries {protocol.name}, "
        f"surgsim {lock['surgsim']} (commit {_short(lock['commit'])})"
    )


def changed_items(protocol: Protocol) -> list[str]:
    """Names of all items that are not as they were frozen.

    Raises:
        SurgsimError: If it is not frozen, or makes a scenario that is not valid.
    """
    return changes(_read(protocol)["items"], all_items(protocol))


def changes(before: Items, now: Items) -> list[str]:
    """Names of items that differ, came or went."""
    return sorted(name for name in before.keys() | now.keys() if before.get(name) != now.get(name))


def frozen_sha256(protocol: Protocol) -> str:
    """The hash of all of the protocol, as it was frozen.

    Raises:
        SurgsimError: If it is not frozen, or its lock is damaged.
    """
    return str(_read(protocol)["sha256"])


def _why_final(protocol: Protocol) -> str:
    if opened := any_open(protocol):
        return f"its round '{opened}' has been opened"
    return "" if protocol.config.draft else "it says draft: false"


def _named(items: Sequence[str]) -> str:
    more = f" and {len(items) - _SHOWN} more" if len(items) > _SHOWN else ""
    return ", ".join(items[:_SHOWN]) + more


def _short(commit: object) -> str:
    return str(commit)[:10] if commit else "unknown"


def _read(protocol: Protocol) -> dict[str, Any]:
    """The protocol's lock.

    Raises:
        SurgsimError: If there is none, or it is damaged.
    """
    path = protocol.lock
    if not path.is_file():
        raise SurgsimError(f"{protocol.name} is not frozen: surgsim protocol freeze {_argument(protocol)}")
    try:
        lock = json.loads(path.read_text(encoding="utf-8"))
        if protocol_sha256(lock["items"]) != lock["sha256"] or lock["protocol"] != protocol.name:
            raise ValueError("its hash is not that of its items")
        lock["surgsim"], lock["commit"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise SurgsimError(f"{path} is damaged: {error}") from error
    return dict(lock)


def _argument(protocol: Protocol) -> str:
    return protocol.name if protocol.name == CURRENT else str(protocol.path)
