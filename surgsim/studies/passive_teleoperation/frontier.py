"""Where the loop becomes unstable: one line for each way of keeping passive, one column for each delay."""

from collections.abc import Sequence
from typing import get_args

from surgsim.studies.passive_teleoperation.stability import UNSTABLE, Steadiness
from surgsim.studies.study import Cell, Row
from surgsim.studies.vprnn.cells import number

BY_SEVERITY: tuple[Steadiness, ...] = get_args(Steadiness)
_KEYS = ("place", "grip", "link", "passivity")


def frontier_table(pushes: Sequence[Row]) -> list[Row]:
    """How each push ends, the worst over its seeds, and the smallest delay at which it is unstable."""
    delays = sorted({round(number(row, "delay_ms")) for row in pushes})
    groups: dict[tuple[Cell, ...], list[Row]] = {}
    for row in pushes:
        groups.setdefault(tuple(row[key] for key in _KEYS), []).append(row)
    return [_line(key, rows, delays) for key, rows in groups.items()]


def _line(key: tuple[Cell, ...], rows: Sequence[Row], delays: Sequence[int]) -> Row:
    ends = {delay: worst([row for row in rows if row["delay_ms"] == delay]) for delay in delays}
    unstable = [delay for delay, end in ends.items() if end in UNSTABLE]
    return {
        **dict(zip(_KEYS, key, strict=True)),
        **{f"{delay}_ms": end for delay, end in ends.items()},
        "unstable_from_ms": min(unstable) if unstable else None,
    }


def worst(rows: Sequence[Row]) -> str | None:
    """The worst of the rows' ends; None without rows."""
    names: list[str] = [name for name in BY_SEVERITY if name in {row["end"] for row in rows}]
    return names[-1] if names else None
