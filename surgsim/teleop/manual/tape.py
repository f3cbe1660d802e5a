"""A person's input on record, and played again."""

import csv
import math
from collections.abc import Sequence
from pathlib import Path

from surgsim.errors import SurgsimError
from surgsim.teleop.manual.intent import Intent, Source

_VELOCITY = ("velocity_x_m_per_s", "velocity_y_m_per_s", "velocity_z_m_per_s")
HEADER = ("t_s", *_VELOCITY, "jaw", "roll", "clutch", "end")
_FASTEST_M_PER_S = 10.0
Rows = list[tuple[float, Intent]]


class Recorder:
    """Passes `source` on and keeps every change of it, with its time."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._rows: Rows = []

    def __call__(self, t_s: float) -> Intent:
        """The input at `t_s` [s]."""
        intent = self._source(t_s)
        if not self._rows or intent != self._rows[-1][1]:
            self._rows.append((t_s, intent))
        return intent

    def text(self) -> str:
        """The record as CSV: the header, then a line for every change; numbers read back exactly."""
        lines = [",".join(HEADER)]
        for t_s, intent in self._rows:
            numbers = (t_s, *intent.velocity, intent.jaw, intent.roll)
            pressed = (str(int(state)) for state in (intent.clutch, intent.end))
            lines.append(",".join([*(repr(float(number)) for number in numbers), *pressed]))
        return "\n".join(lines) + "\n"


class Player:
    """The input of a record: each line holds from its time on."""

    def __init__(self, rows: Sequence[tuple[float, Intent]]) -> None:
        self._rows = rows
        self._next = 0
        self._intent = Intent()

    def __call__(self, t_s: float) -> Intent:
        """The input at `t_s` [s]."""
        while self._next < len(self._rows) and self._rows[self._next][0] <= t_s:
            self._intent = self._rows[self._next][1]
            self._next += 1
        return self._intent


def read_tape(path: Path) -> Rows:
    """Read a record.

    Raises:
        SurgsimError: If it cannot be read or is no record, with the line.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            lines = list(csv.reader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise SurgsimError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from error
    if not lines or tuple(lines[0]) != HEADER:
        raise SurgsimError(
            f"{path}:1: not a record of an operator's input: it begins with {','.join(HEADER)}"
        )
    rows: Rows = []
    for number, fields in enumerate(lines[1:], start=2):
        try:
            rows.append(_row(fields, after_s=rows[-1][0] if rows else -math.inf))
        except ValueError as error:
            raise SurgsimError(f"{path}:{number}: {error}") from error
    return rows


def _row(fields: Sequence[str], after_s: float) -> tuple[float, Intent]:
    """One line.

    Raises:
        ValueError: If it is not one of a record, or not later than `after_s` [s].
    """
    if len(fields) != len(HEADER):
        raise ValueError(f"{len(fields)} values, not {len(HEADER)}")
    numbers = (_number(name, text) for name, text in zip(HEADER, fields, strict=True))
    t_s, x, y, z, jaw, roll, clutch, end = numbers
    if not max(abs(x), abs(y), abs(z)) <= _FASTEST_M_PER_S:
        raise ValueError(f"velocity above {_FASTEST_M_PER_S:g} m/s")
    if t_s <= after_s:
        raise ValueError(f"t_s {t_s:g} is not after the line before, {after_s:g}")
    if not 0.0 <= jaw <= 1.0:
        raise ValueError(f"jaw {jaw:g} is not from 0 to 1")
    if not -1.0 <= roll <= 1.0:
        raise ValueError(f"roll {roll:g} is not from -1 to 1")
    for name, state in (("clutch", clutch), ("end", end)):
        if state not in (0.0, 1.0):
            raise ValueError(f"{name} {state:g} is neither 0 nor 1")
    return t_s, Intent(velocity=(x, y, z), jaw=jaw, roll=roll, clutch=clutch == 1.0, end=end == 1.0)


def _number(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"{name} '{text[:40]}' is not a finite number")
    return value


def source_of(path: Path) -> Source:
    """The input on record in `path`.

    Raises:
        SurgsimError: If it is no record.
    """
    return Player(read_tape(path))
