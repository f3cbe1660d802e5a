"""What of a scenario is hashed: all that can change its runs, wherever its files stand."""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from surgsim.catalog import ADDED
from surgsim.scenario.files import files_in


def sha256_of_config(config: BaseModel) -> str:
    """SHA-256 of a config with its defaults, but for keys that are marked as `ADDED` and left at theirs."""
    return hashlib.sha256(
        json.dumps(hashed(config), sort_keys=True, separators=(",", ":")).encode()
    ).hexdigest()


def hashed(config: BaseModel) -> dict[str, Any]:
    """A config as plain data, without what cannot change a run.

    Left out are keys that are marked as `ADDED` and have their default, so that a new one changes no hash of
    a scenario that does not use it; and the folders of files: their contents count where they are read.

    Args:
        config: A scenario of one arm or of several, or a part of one.
    """
    data: dict[str, Any] = json.loads(config.model_dump_json())
    _leave_out(config, data)
    for holder in (data, *_mappings(data.get("arms"))):
        for mapping, key in files_in(holder):
            mapping[key] = Path(mapping[key]).name
    return data


def _same(one: object, other: object) -> bool:
    return type(one) is type(other) and one == other


def _mappings(data: object) -> list[dict[str, Any]]:
    return [each for each in data if isinstance(each, dict)] if isinstance(data, list) else []


def _leave_out(value: object, data: object) -> None:
    """Take the keys that were added and have their default out of `data`, which `value` was written as."""
    if isinstance(value, BaseModel) and isinstance(data, dict):
        for name, info in type(value).model_fields.items():
            own = getattr(value, name)
            if ADDED in info.metadata and _same(own, info.get_default(call_default_factory=True)):
                data.pop(name, None)
            else:
                _leave_out(own, data.get(name))
    elif isinstance(value, Mapping) and isinstance(data, dict):
        for key, own in value.items():
            _leave_out(own, data.get(key))
    elif isinstance(value, tuple | list) and isinstance(data, list):
        for own, written in zip(value, data, strict=True):
            _leave_out(own, written)
