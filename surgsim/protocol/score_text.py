"""A score in words and figures, the same in the terminal and on its page."""

from collections.abc import Mapping
from typing import Any

from surgsim.display import count, number
from surgsim.protocol.score import Score

_NOTHING = 1e-12


def sentence(score: Score) -> list[str]:
    """What is to be known first: failures, then where the axes end."""
    card = score.scorecard
    runs, bad = card["runs"], card["failures"]
    arms = ", ".join(card["arms"])
    kinds = ", ".join(f"{many} {name.replace('_', ' ')}" for name, many in bad.items())
    failed = (
        f"{sum(bad.values())} of {count(runs, 'run')} failed ({kinds})"
        if bad
        else f"none of {count(runs, 'run')} failed"
    )
    axes = card["axes"]
    held = sum(axis["first_failing"] is None for axis in axes)
    unchanged = sum(axis["first_failing"] == 0 for axis in axes)
    lines = [f"{score.name} on {arms}: {failed}."]
    if axes:
        at_once = f", and fails on {unchanged} before anything is changed" if unchanged else ""
        lines.append(f"It holds every level of {held} of {_axes(len(axes))}{at_once}.")
    if card["unreachable"]:
        lines.append(f"{count(card['unreachable'], 'drawn port')} no controller could reach: not counted.")
    if score.content["draft"]:
        lines.append("The protocol is a draft: a score of it is not yet one of record.")
    return lines


def _axes(amount: int) -> str:
    return f"{amount} {'axis' if amount == 1 else 'axes'}"


def figure_told(figure: Mapping[str, Any]) -> tuple[str, str]:
    """A figure's value and interval: `0.51`, `0.4 to 0.6`."""
    value, low, high = figure["value"], figure["low"], figure["high"]
    if value is None:
        return "-", (figure["note"] or "no value").partition(",")[0]
    if low is None and high is None:
        return _told(value), ""
    upper = "open" if high is None else _told(high)
    return _told(value), f"{'open' if low is None else _told(low)} to {upper}"


def _told(value: float) -> str:
    """Three digits; what rounding left of a share of nothing is 0."""
    return number(0.0 if abs(value) < _NOTHING else value, 3)


def axis_told(axis: Mapping[str, Any]) -> str:
    """Where an axis ends: `fails at 5: 3 of 12 runs, velocity limit`."""
    place = axis["first_failing"]
    if place is None:
        return f"holds to {axis['levels'][-1]['level']:g}"
    at = axis["levels"][place]
    why = ", ".join(name.replace("_", " ") for name in at["why"])
    where = "fails with nothing changed" if place == 0 else f"fails at {at['level']:g}"
    return f"{where}: {at['failed']} of {count(at['runs'], 'run')}, {why}"


def timing_told(score: Score) -> str:
    """Deadline misses, of the machine that ran it."""
    missed = score.timing["deadline_miss_fraction"]
    return "-" if missed is None else f"{number(100.0 * missed['mean'], 2)} %"


def tuning_told(tuning: Mapping[str, Any]) -> str:
    """What its gains cost."""
    if tuning["runs"] is None:
        return "not declared"
    return f"{count(tuning['runs'], 'run')}, {tuning['source']}"
