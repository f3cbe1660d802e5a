"""Scenario content from Python instead of a file: as plain data, or as `key.path=value` settings."""

import json
import math
import os
from collections.abc import Iterator, Mapping
from typing import Any

from surgsim.catalog import PartConfig
from surgsim.errors import ScenarioError
from surgsim.scenario.messages import dotted, one_line
from surgsim.scenario.yaml_events import MAX_DEPTH, KeyPath
from surgsim.scenario.yaml_text import YamlDocument

GIVEN_SCENARIO = "given scenario"
"""What errors call a scenario that has no file."""


def document_of(content: Mapping[str, Any] | PartConfig, label: str = GIVEN_SCENARIO) -> YamlDocument:
    """`content` as a document whose errors are located by `label` and key.

    Raises:
        ScenarioError: If it holds something that YAML cannot say.
    """
    return YamlDocument(tree=plain(content, label), lines={(): label}, source=label)


def plain(value: Any, label: str, path: KeyPath = ()) -> Any:
    """`value` with mappings, sequences, NumPy's arrays and numbers, paths and configs as JSON's own kinds.

    Raises:
        ScenarioError: If it is of another kind, not finite, or nested too deeply.
    """
    where = f"{label}: {dotted(path)}" if path else label
    if len(path) > MAX_DEPTH:
        raise ScenarioError(where, f"nested deeper than {MAX_DEPTH} levels")
    if isinstance(value, PartConfig):
        return json.loads(value.model_dump_json())
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if hasattr(value, "tolist"):  # NumPy's arrays and numbers
        value = value.tolist()
    if isinstance(value, Mapping):
        return {_key(key, where): plain(item, label, (*path, key)) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item, label, (*path, index)) for index, item in enumerate(value)]
    if isinstance(value, float) and not math.isfinite(value):
        raise ScenarioError(where, f"{value} is not a finite number")
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise ScenarioError(
        where, f"{one_line(repr(value))} ({type(value).__name__}) is not a value of a scenario"
    )


def _key(key: Any, where: str) -> str:
    if not isinstance(key, str):
        raise ScenarioError(where, f"the key {one_line(repr(key))} is not a string")
    return key


def assignments_of(blocks: Mapping[str, Any], settings: Mapping[str, Any] | None = None) -> tuple[str, ...]:
    """The `key.path=value` settings that Python's keywords mean, first those of `blocks`.

    A mapping changes the keys that it names and leaves the rest; one with the key `type`, and any other
    value, takes the place of what was there.

    Args:
        blocks: Values by a scenario's top-level key, e.g. `{"task": {"radius_m": 0.01}}`.
        settings: Values by key path, e.g. `{"disturbances.0.mass_kg": 0.3}`.

    Raises:
        ScenarioError: If a value is none that a scenario can hold.

    Example:
        >>> from surgsim.scenario.plain import assignments_of
        >>> assignments_of({"task": {"radius_m": 0.01}}, {"disturbances.0.mass_kg": 0.3})
        ('task.radius_m=0.01', 'disturbances.0.mass_kg=0.3')
    """
    made = [_assignment(path, value) for key, item in blocks.items() for path, value in _leaves(key, item)]
    return (*made, *(_assignment(key, value) for key, value in (settings or {}).items()))


def _leaves(path: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Key paths with the values that are put there."""
    if isinstance(value, Mapping) and value and "type" not in value:
        for key, item in value.items():
            yield from _leaves(f"{path}.{_key(key, f'--set {path}')}", item)
    else:
        yield path, value


def _assignment(path: Any, value: Any) -> str:
    name = _key(path, "--set")
    return f"{name}={json.dumps(plain(value, f'--set {name}'), ensure_ascii=False)}"
