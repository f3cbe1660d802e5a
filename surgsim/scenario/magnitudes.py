"""How large a number of a scenario may be, by the unit that its key ends in.

A place 1e9 m away is a slip of the pen, and its square is beyond what double precision tells apart from the
arm. Bounds are wide: within them a scenario may be impossible, but what refuses it can still compute.
"""

from collections.abc import Iterator
from typing import Any

from surgsim.errors import ScenarioError
from surgsim.scenario.yaml_events import KeyPath
from surgsim.scenario.yaml_text import YamlDocument

LEAST, MOST = 1e-30, 1e15
"""Of a pure number: the product of a few still fits in double precision."""

UNITS: dict[str, tuple[str, float]] = {
    "m": ("m", 100.0),
    "mm": ("mm", 1e5),
    "rad": ("rad", 100.0),
    "s": ("s", 1e9),
    "n": ("N", 1e6),
    "nm": ("N m", 1e6),
    "kg": ("kg", 1e3),
    "hz": ("Hz", 1e6),
    "j": ("J", 1e6),
    "w": ("W", 1e6),
    "m_per_s": ("m/s", 1e3),
    "rad_per_s": ("rad/s", 1e4),
    "n_per_m": ("N/m", 1e9),
    "n_s_per_m": ("N s/m", 1e9),
    "ns_per_m": ("N s/m", 1e9),
    "nm_per_rad": ("N m/rad", 1e9),
    "nm_s_per_rad": ("N m s/rad", 1e9),
    "nms_per_rad": ("N m s/rad", 1e9),
    "per_s": ("1/s", 1e9),
    "per_s2": ("1/s^2", 1e12),
}
"""Ending of a key: what the unit is called, and the largest size of a number in it."""


def check_magnitudes(document: YamlDocument) -> None:
    """Refuse numbers that are beyond what their unit allows, or what can be computed with.

    Raises:
        ScenarioError: For the first one.
    """
    for path, value in _numbers(document.tree):
        ending = unit_of(path)
        unit, most = UNITS[ending] if ending else ("", MOST)
        if value and not LEAST <= abs(value) <= most:
            number = f"a number in {unit}" if unit else "a number"
            reason = (
                f"{value:g} is not allowed: the size of {number} must be 0, or from {LEAST:g} to {most:g}"
            )
            far = ending == "m" and abs(value) > most
            remark = "; what is farther away cannot be reached" if far else ""
            raise ScenarioError(document.where(path), reason + remark)


def _numbers(tree: Any, path: KeyPath = ()) -> Iterator[tuple[KeyPath, float]]:
    """Every number, and its place; whole ones only where the key has a unit, the others have bounds."""
    for key, value in tree.items() if isinstance(tree, dict) else enumerate(tree):
        here = (*path, key)
        if isinstance(value, float) or (type(value) is int and unit_of(here) is not None):
            yield here, value
        elif isinstance(value, dict | list):
            yield from _numbers(value, here)


def unit_of(path: KeyPath) -> str | None:
    """The longest ending of the last key that is a unit; None for a pure number or another unit."""
    key = next((str(key) for key in reversed(path) if isinstance(key, str)), "")
    words = key.split("_")
    endings = ("_".join(words[i:]) for i in range(1, len(words)))
    return next((ending for ending in endings if ending in UNITS), None)
