"""Files that a scenario names: where they stand in its content."""

from collections.abc import Iterator
from typing import Any

from surgsim.models.config import KINDS

File = tuple[dict[str, Any], str]
"""A mapping, and the key in it whose value is the path."""


def files_in(holder: dict[str, Any]) -> Iterator[File]:
    """The files of a scenario, or of an arm of one: of the robot, the instrument, and recorded networks."""
    for part in ("robot", "instrument"):
        yield from _named(holder.get(part), KINDS)
    task = holder.get("task")
    for channel in task.values() if isinstance(task, dict) else ():
        yield from _named(channel, ("trace",))


def _named(given: Any, keys: tuple[str, ...]) -> Iterator[File]:
    if isinstance(given, dict):
        yield from ((given, key) for key in keys if isinstance(given.get(key), str))
