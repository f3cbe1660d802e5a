"""A controller's gains: which there are, and the space in which they are searched."""

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeGuard

import annotated_types

from surgsim.catalog import PartConfig
from surgsim.control.controller import ControllerConfig
from surgsim.errors import SurgsimError, unknown_name
from surgsim.scenario.load import load_controller
from surgsim.scenario.messages import Shape, unwrap

RANGE = 30.0
"""Largest factor on a gain's first value, either way."""
DIGITS = 3
"""Significant digits of what is tried, and written."""
_NO_GAIN = re.compile(
    r"(^|_)(max|min|most|lead|cap|bound|share|step|delay|speed)(_|$)|(?<!per)(?<!_nm)_(s|m)$"
)
"""Names of limits, times, lengths and numerical steps: they are searched if they are asked for alone."""

Value = float | tuple[float, ...]
Values = Mapping[str, Value]


@dataclass(frozen=True, kw_only=True)
class Gain:
    """A gain, or a list of gains that keep their ratios.

    Attributes:
        key: Its place in the controller's file, e.g. `torque_law.rcm_stiffness_per_s2`.
        start: Its first value, as a list of one or more numbers, none of them negative.
        listed: Whether it is a list in the file.
        low: Smallest value that the file may have.
        high: Largest value that the file may have.
    """

    key: str
    start: tuple[float, ...]
    listed: bool
    low: float = 0.0
    high: float = math.inf

    @property
    def positions(self) -> tuple[float, float]:
        """Lowest and highest position of the search: within the range, and within what is allowed."""
        positive = [value for value in self.start if value > 0.0]
        room = [math.log(self.high / value) / math.log(RANGE) for value in positive]
        below = [math.log(value / self.low) / math.log(RANGE) for value in positive if self.low > 0.0]
        return -min([1.0, *below]), min([1.0, *room])

    def at(self, position: float) -> Value:
        """Its value at a position of the search, x = ln(value / start) / ln(RANGE), rounded."""
        return self.scaled(self._as_given(self.start), RANGE**position)

    def position_of(self, value: Value) -> float:
        """Inverse of `at`, but for the rounding: by the largest number of a list."""
        pairs = zip(_numbers(value), self.start, strict=True)
        now, first = max(pairs, key=lambda pair: pair[1])
        return math.log(now / first) / math.log(RANGE)

    def scaled(self, value: Value, factor: float) -> Value:
        """`value` times a factor, rounded, and within what the file may have."""
        return self._as_given([self._allowed(number * factor) for number in _numbers(value)])

    def is_at_the_edge(self, value: Value) -> bool:
        """Whether a value is as far from the first one as the search goes, and the file might go on."""
        low, high = self.positions
        x, edge = self.position_of(value), math.log1p(10.0 ** (1 - DIGITS)) / math.log(RANGE)
        return (low == -1.0 and x < low + edge) or (high == 1.0 and x > high - edge)

    def _allowed(self, number: float) -> float:
        return min(max(rounded(number), self.low), self.high)

    def _as_given(self, numbers: Sequence[float]) -> Value:
        return tuple(numbers) if self.listed else numbers[0]


def rounded(value: float) -> float:
    """`value` with three significant digits."""
    return float(f"{value:.{DIGITS - 1}e}")


def gains_of(controller: ControllerConfig, joints: int, keys: Sequence[str] | None = None) -> list[Gain]:
    """The gains of a controller that are searched.

    Args:
        controller: Its file's content.
        joints: Number of the arm's joints: lists at null are written out for them.
        keys: Their places; None: all gains of torque law and resolver.

    Raises:
        SurgsimError: If a key names no number that can be searched, or there is no gain.
    """
    known = {gain.key: gain for gain in _all(controller, joints)}
    searched = {key: gain for key, gain in known.items() if any(gain.start)}
    if keys is None:
        chosen = [gain for key, gain in searched.items() if _is_a_gain(key)]
        if not chosen:
            raise SurgsimError(f"controller '{controller.name}' has no gains that can be tuned")
        return chosen
    for key in keys:
        if key not in known:
            raise SurgsimError(f"--keys: {unknown_name(key, f'gain of {controller.name}', searched)}")
        if key not in searched:
            raise SurgsimError(f"--keys: {key} is 0: only positive numbers are searched")
    return [known[key] for key in dict.fromkeys(keys)]


def with_values(controller: ControllerConfig, values: Values, name: str | None = None) -> ControllerConfig:
    """`controller` with other values of gains, and another name.

    Raises:
        ScenarioError: If a part refuses them.
    """
    tree: dict[str, Any] = json.loads(controller.model_dump_json())
    for key, value in values.items():
        *above, last = key.split(".")
        node = tree
        for part in above:
            node = node[part]
        node[last] = list(value) if isinstance(value, tuple) else value
    return load_controller({**tree, "name": name or controller.name})


def _is_a_gain(key: str) -> bool:
    part, _, name = key.partition(".")
    return part in ("torque_law", "resolver") and not _NO_GAIN.search(name)


def _all(controller: ControllerConfig, joints: int) -> Iterator[Gain]:
    """Every number and list of numbers of a controller that is not negative."""
    for part in ("torque_law", "resolver", "port"):
        config = getattr(controller, part)
        if config is not None:
            yield from _gains_in(config, part, joints)
    yield from _gains_in(controller, "", joints)


def _gains_in(config: PartConfig, above: str, joints: int) -> Iterator[Gain]:
    config = config.written_out(joints)
    for name, field in type(config).model_fields.items():
        key, value = f"{above}.{name}" if above else name, getattr(config, name)
        shape = unwrap(field.annotation, (field,))
        if isinstance(value, PartConfig) and above:
            yield from _gains_in(value, key, joints)
        elif _is_number(value) and value >= 0.0:
            low, high = _bounds(shape)
            yield Gain(key=key, start=(value,), listed=False, low=low, high=high)
        elif isinstance(value, tuple) and value and all(_is_number(x) and x >= 0.0 for x in value):
            low, high = _bounds(shape.child(0))
            yield Gain(key=key, start=value, listed=True, low=low, high=high)


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, float)


def _bounds(shape: Shape) -> tuple[float, float]:
    """Smallest and largest number that a shape allows; next to a bound that is itself left out."""
    low, high = 0.0, math.inf
    for note in (part for given in shape.notes for part in getattr(given, "metadata", [given])):
        if not isinstance(note, annotated_types.BaseMetadata):
            continue
        at_least, above = getattr(note, "ge", None), getattr(note, "gt", None)
        at_most, below = getattr(note, "le", None), getattr(note, "lt", None)
        low = max([low, *_floats(at_least), *(math.nextafter(bound, math.inf) for bound in _floats(above))])
        high = min([high, *_floats(at_most), *(math.nextafter(bound, 0.0) for bound in _floats(below))])
    return low, high


def _floats(bound: Any) -> list[float]:
    """A bound as a list of one number, or of none."""
    return [] if bound is None else [float(bound)]


def _numbers(value: Value) -> tuple[float, ...]:
    return value if isinstance(value, tuple) else (value,)
