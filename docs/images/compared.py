"""Tables of how figures are compared: margins of the metrics, measured coverage of the intervals."""

import json
from pathlib import Path
from typing import Any

from surgsim.compare.figure_text import exactly, heading_of
from surgsim.metrics.catalog import METRICS
from surgsim.metrics.metric import Source

COVERAGE = Path(__file__).resolve().parents[2] / "benchmarks" / "interval_coverage.json"
_KINDS = ("clinical", "instrument", "choice", "none")

Table = tuple[list[str], list[list[str]]]
"""Its head and its lines."""


def margins() -> Table:
    """The smallest difference that matters of every metric, those of one size and source on one line."""
    groups: dict[tuple[float, str, Source], list[str]] = {}
    for metric in METRICS.values():
        size = (metric.matters, heading_of(metric)[1] if metric.matters else "", metric.matters_source)
        groups.setdefault(size, []).append(f"`{metric.name}`")
    ordered = sorted(groups.items(), key=lambda item: (_KINDS.index(item[0][2].kind), *item[0][1::-1]))
    lines = [
        [exactly(size, unit) if size else "any", source.kind, str(source), ", ".join(names)]
        for (size, unit, source), names in ordered
    ]
    return ["margin", "kind", "source", "metrics"], lines


def coverage() -> Table:
    """Measured coverage of the intervals, by law and number of seeds."""
    kept = _kept()
    lines = [
        [method, law, *(f"{100 * count / kept['trials']:.1f}" for count in by_size.values())]
        for method, laws in kept["covered"].items()
        for law, by_size in laws.items()
    ]
    sizes = next(iter(next(iter(kept["covered"].values())).values()))
    return ["covered [%] of", "law", *(f"n = {n}" for n in sizes)], lines


def coverage_of_rates() -> Table:
    """Coverage of the Wilson interval, computed."""
    rates = _kept()["completion rate"]
    lines = [[rate, *(f"{100 * share:.1f}" for share in shares.values())] for rate, shares in rates.items()]
    return ["covered [%], true rate", *(f"n = {n}" for n in next(iter(rates.values())))], lines


def _kept() -> dict[str, Any]:
    kept: dict[str, Any] = json.loads(COVERAGE.read_text(encoding="utf-8"))
    return kept
