"""Axes: from values to places on paper."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from surgsim.report.figures.ticks import log_ticks, round_ticks, tick_texts

_LOG_FROM_RATIO = 30.0
_ZERO_SHARE = 0.08
"""Share of a logarithmic axis between the place of zero and that of the least positive value."""


@dataclass(frozen=True, kw_only=True)
class Scale:
    """A linear or logarithmic axis.

    A logarithmic axis has no place for zero. Where values are zero (or negative), it gets one at its start,
    apart from the rest and with a tick of its own.

    Attributes:
        low: Value at `start`; on a logarithmic axis with a place for zero, at the place beside it.
        high: Value at `end`.
        start: Place of `low`.
        end: Place of `high`.
        log: Whether it is logarithmic.
        below: What the place of values that are not positive is called, `0` or `≤ 0`; empty without one.
    """

    low: float
    high: float
    start: float
    end: float
    log: bool = False
    below: str = ""

    @staticmethod
    def over(values: Iterable[float], start: float, end: float, *, log: bool | None = None) -> "Scale":
        """An axis with some room around `values`; logarithmic, if not said, where they span much.

        Without a positive value it is linear, whatever `log` says.
        """
        finite = [value for value in values if math.isfinite(value)]
        low, high = min(finite, default=0.0), max(finite, default=1.0)
        positive = [value for value in finite if value > 0.0]
        if log is None:
            log = low >= 0.0 and bool(positive) and high / min(positive) > _LOG_FROM_RATIO
        if log and positive:
            least = min(positive)
            room = max(high / least, 1.5) ** 0.04
            below = "" if low > 0.0 else ("0" if low == 0.0 else "≤ 0")
            return Scale(low=least / room, high=high * room, start=start, end=end, log=True, below=below)
        room = 0.06 * (high - low) or 0.05 * abs(high) or 1.0
        bottom = max(low - room, 0.0) if low >= 0.0 else low - room
        return Scale(low=bottom, high=high + room, start=start, end=end)

    def named(self, label: str) -> str:
        """What the axis is called: its `label`, and that it is logarithmic if it is."""
        return f"{label}, log scale" if self.log else label

    def at(self, value: float) -> float:
        """Place of `value`, kept on the axis."""
        if not self.log:
            return self._place((value - self.low) / (self.high - self.low))
        if value <= 0.0 and self.below:
            return self.start
        share = math.log(max(value, self.low) / self.low) / math.log(self.high / self.low)
        gap = _ZERO_SHARE if self.below else 0.0
        return self._place(gap + (1.0 - gap) * share)

    def _place(self, share: float) -> float:
        return self.start + min(max(share, 0.0), 1.0) * (self.end - self.start)

    def ticks(self) -> list[float]:
        """Three to six round values on the axis, and the place of zero where there is one."""
        if not self.log:
            return round_ticks(self.low, self.high)
        return [*([0.0] if self.below else []), *log_ticks(self.low, self.high)]

    def labels(self) -> list[tuple[float, str]]:
        """Places of the ticks and what is written there; no two are written alike."""
        ticks = self.ticks()
        texts = tick_texts(ticks)
        if self.below:
            texts[0] = self.below
        return [(self.at(tick), text) for tick, text in zip(ticks, texts, strict=True)]
