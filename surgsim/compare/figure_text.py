"""Figures and intervals as a person reads them."""

import math
from collections.abc import Mapping, Sequence

from surgsim.compare.intervals import Interval
from surgsim.display import count
from surgsim.metrics.metric import Metric


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


def heading_of(metric: Metric) -> tuple[str, str]:
    """A metric's heading without its unit, and the unit; the latter is empty for a pure number."""
    words, _, unit = metric.heading.partition(" [")
    return words, unit.removesuffix("]")


def exactly(value: float, unit: str) -> str:
    """A figure that was set, as it was set: `0.1 mm`."""
    return f"{value:g} {unit}".rstrip().replace("-", "−")


def with_unit(value: float | None, unit: str, digits: int = 3) -> str:
    """`1.58 mm`."""
    return f"{number(value, digits)} {unit}".rstrip()


def seeds_of(sizes: Sequence[int]) -> str:
    """How many seeds each scenario has: `20 seeds in each of 2 scenarios`."""
    if len(sizes) == 1:
        return count(sizes[0], "seed")
    if len(set(sizes)) == 1:
        return f"{count(sizes[0], 'seed')} in each of {len(sizes)} scenarios"
    return f"{min(sizes)} to {max(sizes)} seeds in each of {len(sizes)} scenarios" if sizes else "no seed"


def listed(names: Sequence[str], most: int = 4) -> str:
    """`a`, `a and b`, `a, b and c`; of many the first ones and how many more."""
    if len(names) > most:
        return f"{', '.join(names[: most - 1])} and {len(names) - most + 1} more"
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def counted(counts: Mapping[str, int]) -> str:
    """`2 rcm_limit, 1 diverged`, the most frequent first."""
    items = sorted(counts.items(), key=lambda item: (-item[1], item[0]))
    return ", ".join(f"{times} {name}" for name, times in items if times)
