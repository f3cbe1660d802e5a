"""The axes and sweeps of a suite, as the report needs them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from surgsim.report.results import Results, parameters_of


@dataclass(frozen=True, kw_only=True)
class Axis:
    """A quantity that the suite varied.

    Attributes:
        name: Its key in the table's parameters.
        label: What figures call it.
        levels: Its levels, rising, of which there are runs.
    """

    name: str
    label: str
    levels: tuple[float, ...]


def axes_of(results: Results) -> list[Axis]:
    """What was varied in every combination."""
    return _named(results, "axes")


def sweeps_of(results: Results) -> list[Axis]:
    """What was varied one at a time."""
    return _named(results, "sweeps")


def _named(results: Results, kind: str) -> list[Axis]:
    """Axes of `suite.json` that the table has levels of."""
    told = results.suite.get(kind)
    points = [parameters_of(text) for text in dict.fromkeys(results.runs.parameters.tolist())]
    found = []
    for name, axis in (told if isinstance(told, Mapping) else {}).items():
        levels = sorted({float(point[name]) for point in points if _is_number(point.get(name))})
        if levels:
            found.append(Axis(name=name, label=_label(name, axis), levels=tuple(levels)))
    return found


def _label(name: str, axis: Any) -> str:
    label = axis.get("label") if isinstance(axis, Mapping) else None
    return str(label or name.replace("_", " "))


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
