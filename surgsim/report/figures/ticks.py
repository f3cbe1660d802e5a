"""Where to put the ticks of an axis, and how to write them."""

import itertools
import math
from collections.abc import Iterator, Sequence

_FEWEST, _MOST = 3, 7
_STEPS = ((1.0, 3.0), (1.0, 2.0, 5.0), (1.0, 1.5, 2.0, 3.0, 5.0, 7.0))
"""Values in each decade of a logarithmic axis that spans few."""
_DIGITS = range(5, 16)
_CHARACTERS = 50.0
"""Characters that fit side by side along an axis."""


def round_ticks(low: float, high: float) -> list[float]:
    """Three to seven multiples of a round step, from `low` to `high`."""
    found = _all_multiples(low, high)
    fitting = (ticks for ticks in found if _fit(ticks, [(value - low) / (high - low) for value in ticks]))
    return next(fitting, found[0])


def log_ticks(low: float, high: float) -> list[float]:
    """Three to seven round values between `low` > 0 and `high`, spread over a logarithmic axis.

    Of powers of ten, round steps within each, and multiples, those that leave the smallest stretch bare.
    """
    fitting = [ticks for ticks in _candidates(low, high) if _fit(ticks, _places(low, high, ticks))]
    return min(fitting, key=lambda ticks: _bare(low, high, ticks), default=[low, high])


def tick_text(value: float, digits: int = 8) -> str:
    """A tick's value in as few characters as it takes, to `digits` significant digits."""
    if value != 0.0 and not 1e-3 <= abs(value) < 1e5:
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        text = f"{float(mantissa):.{digits}g}e{int(exponent)}"
    else:
        text = f"{value:.{digits}g}"
    return text.replace("-", "−")


def tick_texts(ticks: Sequence[float]) -> list[str]:
    """Texts of several ticks, with as many digits as tell them apart."""
    tried = ([tick_text(tick, digits) for tick in ticks] for digits in _DIGITS)
    return next(
        (texts for texts in tried if len(set(texts)) == len(texts)), [tick_text(t, 17) for t in ticks]
    )


def _all_multiples(low: float, high: float) -> list[list[float]]:
    """Multiples of every round step: of 1, 2 and 5 times a power of ten first, then of 2.5 and 4."""
    power = 10.0 ** math.floor(math.log10(0.25 * (high - low)))
    usual = [step * power for step in (2.0, 5.0, 1.0, 10.0, 20.0, 0.5)]
    usual.sort(key=lambda step: abs(math.log(4.0 * step / (high - low))))
    return [
        _multiples(low, high, step) for step in (*usual, 2.5 * power, 4.0 * power, 0.4 * power, 0.25 * power)
    ]


def _multiples(low: float, high: float, step: float) -> list[float]:
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [_round(k * step) for k in range(first, last + 1)]


def _candidates(low: float, high: float) -> Iterator[list[float]]:
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    for every in itertools.count(1):
        yield _inside(low, high, (10.0**e for e in range(first, last + 1) if e % every == 0))
        if every * _FEWEST > last - first:
            break
    for steps in _STEPS if last - first < 8 else ():
        yield _inside(low, high, (s * 10.0**e for e in range(first, last + 1) for s in steps))
    if high / low < 100.0:
        yield from _all_multiples(low, high)


def _inside(low: float, high: float, values: Iterator[float]) -> list[float]:
    return [_round(value) for value in values if low <= value <= high]


def _bare(low: float, high: float, ticks: Sequence[float]) -> float:
    """The longest stretch without a tick, as a share of the axis."""
    places = [0.0, *_places(low, high, ticks), 1.0]
    return max(after - before for before, after in itertools.pairwise(places))


def _places(low: float, high: float, ticks: Sequence[float]) -> list[float]:
    """Where ticks are on a logarithmic axis, as shares of it."""
    return [math.log(value / low) / math.log(high / low) for value in ticks]


def _fit(ticks: Sequence[float], places: Sequence[float]) -> bool:
    """Whether ticks at these shares of an axis are neither few nor many, and their texts stand apart."""
    widths = [len(text) / _CHARACTERS for text in tick_texts(ticks)]
    apart = (
        after - before > 0.5 * (left + right) + 0.5 / _CHARACTERS
        for (before, after), (left, right) in zip(
            itertools.pairwise(places), itertools.pairwise(widths), strict=True
        )
    )
    return _FEWEST <= len(ticks) <= _MOST and all(apart)


def _round(value: float) -> float:
    """Without the rounding of a product: 3e-7 for 3.0000000000000004e-7."""
    return float(f"{value:.15g}")
