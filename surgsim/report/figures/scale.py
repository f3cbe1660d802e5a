"""Axes: from values to places on paper, and where to put the ticks."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

_LOG_FROM_RATIO = 30.0


@dataclass(frozen=True, kw_only=True)
class Scale:
    """A linear or logarithmic axis.

    Attributes:
        low: Value at `start`.
        high: Value at `end`.
        start: Place of `low`.
        end: Place of `high`.
        log: Whether it is logarithmic.
    """

    low: float
    high: float
    start: float
    end: float
    log: bool = False

    @staticmethod
    def over(values: Iterable[float], start: float, end: float, *, log: bool | None = None) -> "Scale":
        """An axis with some room around `values`; logarithmic, if not said, where they span much."""
        finite = [value for value in values if math.isfinite(value)]
        low, high = min(finite, default=0.0), max(finite, default=1.0)
        if log is None:
            log = low > 0.0 and high / low > _LOG_FROM_RATIO
        if log:
            room = max(high / low, 1.5) ** 0.04
            return Scale(low=low / room, high=high * room, start=start, end=end, log=True)
        room = 0.06 * (high - low) or 0.05 * abs(high) or 1.0
        bottom = max(low - room, 0.0) if low >= 0.0 else low - room
        return Scale(low=bottom, high=high + room, start=start, end=end)

    def at(self, value: float) -> float:
        """Place of `value`, kept on the axis."""
        if self.log:
            share = math.log(max(value, self.low) / self.low) / math.log(self.high / self.low)
        else:
            share = (value - self.low) / (self.high - self.low)
        return self.start + min(max(share, 0.0), 1.0) * (self.end - self.start)

    def ticks(self) -> list[float]:
        """Three to six round values on the axis."""
        return self._log_ticks() if self.log else _round_values(self.low, self.high)

    def _log_ticks(self) -> list[float]:
        first, last = math.ceil(math.log10(self.low)), math.floor(math.log10(self.high))
        every = max(1, math.ceil((last - first + 1) / 5))
        decades = [10.0**exponent for exponent in range(first, last + 1, every)]
        if len(decades) >= 3:
            return decades
        fine = [step * 10.0**exponent for exponent in range(first - 1, last + 1) for step in (1, 2, 5)]
        inside = [value for value in fine if self.low <= value <= self.high]
        return inside if 2 <= len(inside) <= 7 else _round_values(self.low, self.high)


def _round_values(low: float, high: float) -> list[float]:
    """Multiples of 1, 2 or 5 times a power of ten."""
    rough = (high - low) / 4.0
    power = 10.0 ** math.floor(math.log10(rough))
    step = power * min((1, 2, 5, 10), key=lambda factor: abs(math.log(factor * power / rough)))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [round(k * step, 12) for k in range(first, last + 1)]
