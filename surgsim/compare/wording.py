"""Figures and intervals as a person reads them."""

import math
from collections.abc import Mapping

from surgsim.compare.intervals import Interval

_UNITS = {
    "mm_per_s": "mm/s",
    "m_per_s": "m/s",
    "mm": "mm",
    "rad": "rad",
    "us": "µs",
    "s": "s",
    "n": "N",
    "nm": "N m",
    "j": "J",
    "kg": "kg",
    "m": "m",
    "deg": "°",
}


def unit_of(name: str) -> str:
    """Unit that a name's suffix says, as it is printed; empty for a pure number."""
    for suffix, unit in _UNITS.items():
        if name.endswith(f"_{suffix}"):
            return unit
    return ""


def number(value: float | None, digits: int = 3) -> str:
    """A figure with `digits` significant digits; a dash where it is not defined."""
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0.0:
        return "0"
    if 1e-3 <= abs(value) < 1e5:
        rounded = float(f"{value:.{digits - 1}e}")
        text = f"{rounded:.{max(0, digits - 1 - math.floor(math.log10(abs(rounded))))}f}"
    else:
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        text = f"{mantissa}e{int(exponent)}"
    return text.replace("-", "−")


def bracket(interval: Interval, digits: int = 3) -> str:
    """`[low, high]`; empty without an interval."""
    if interval.low is None or interval.high is None:
        return ""
    return f"[{number(interval.low, digits)}, {number(interval.high, digits)}]"


def counted(counts: Mapping[str, int]) -> str:
    """`2 rcm_limit, 1 diverged`, the most frequent first."""
    items = sorted(counts.items(), key=lambda item: (-item[1], item[0]))
    return ", ".join(f"{count} {name}" for name, count in items if count)
