"""Where a controller fails first: along every axis of a protocol."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from surgsim.protocol.cells import BASE
from surgsim.protocol.definition import ProtocolConfig
from surgsim.protocol.rows import Row

NOT_DONE, PAST = "not done", "past thresholds"


@dataclass(frozen=True, kw_only=True)
class AtLevel:
    """Runs at one level of an axis.

    Attributes:
        level: The level; None with no axis changed.
        runs: How many count.
        failed: How many of them failed.
        why: Those by outcome, `not done` or `past thresholds`.
    """

    level: float | None
    runs: int
    failed: int
    why: dict[str, int]


@dataclass(frozen=True, kw_only=True)
class AxisResult:
    """A controller along an axis.

    Attributes:
        generator: The axis' generator.
        axis: Its name.
        label: What figures call it.
        levels: With no axis changed first, then its levels as they rise.
        first_failing: Place of the first of `levels` with a run that failed; None if all are held.
        by_arm: The same for each arm alone.
    """

    generator: str
    axis: str
    label: str
    levels: tuple[AtLevel, ...]
    first_failing: int | None
    by_arm: dict[str, int | None]

    @property
    def held(self) -> int:
        """How many levels are held in a row, the unchanged one not counted."""
        first = len(self.levels) if self.first_failing is None else self.first_failing
        return max(0, first - 1)


def axis_results(
    rows: Sequence[Row], protocol: ProtocolConfig, generators: Iterable[str]
) -> list[AxisResult]:
    """Every axis of these generators, in the protocol's order."""
    counted = [row for row in rows if row.counts]
    return [
        _along([row for row in counted if row.generator == generator], protocol, generator, axis)
        for generator in generators
        for axis in protocol.generators[generator].axes
    ]


def _along(rows: Sequence[Row], protocol: ProtocolConfig, generator: str, name: str) -> AxisResult:
    axis = protocol.generators[generator].axes[name]
    points = [(BASE, None), *((name, level) for level in axis.levels)]
    arms = list(dict.fromkeys(row.arm for row in rows))
    groups = [[row for row in rows if (row.axis, row.level) == point] for point in points]
    return AxisResult(
        generator=generator,
        axis=name,
        label=axis.label or name,
        levels=tuple(_at(level, group) for (_, level), group in zip(points, groups, strict=True)),
        first_failing=_first(groups),
        by_arm={arm: _first([[row for row in group if row.arm == arm] for group in groups]) for arm in arms},
    )


def _first(groups: Sequence[Sequence[Row]]) -> int | None:
    return next((place for place, group in enumerate(groups) if any(row.failed for row in group)), None)


def _at(level: float | None, rows: Sequence[Row]) -> AtLevel:
    why = Counter(reason_of(row) for row in rows if row.failed)
    return AtLevel(level=level, runs=len(rows), failed=why.total(), why=dict(sorted(why.items())))


def reason_of(row: Row) -> str:
    """Why a run failed."""
    if not row.completed:
        return row.outcome
    return NOT_DONE if row.success is False else PAST
