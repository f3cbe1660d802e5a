"""The robustness passport as a chart: how far a controller gets along every axis, beside others."""

from collections.abc import Mapping, Sequence
from textwrap import wrap
from typing import TYPE_CHECKING, Any

from surgsim.export.paper_style import colours, new_figure
from surgsim.protocol.definition import ProtocolConfig
from surgsim.protocol.score import Score
from surgsim.protocol.score_text import figure_told, sentence, timing_told, tuning_told

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKS = ("o", "s", "^", "D", "v", "P", "X")
"""Shapes tell controllers apart where colours do not print."""
_ROW_IN, _LINE_IN = 0.4, 0.17
_LEFT, _APART, _RAISED = -0.34, 0.21, 0.12


def passport_figure(score: Score, others: Sequence[Score], protocol: ProtocolConfig) -> "Figure":
    """A row for each axis: its levels from easy to hard, and where each controller fails first.

    A mark stands at the first level that fails; one that holds all of them stands at the right end. Above it
    stands who it is and what failed, below it the scorecard.
    """
    axes = score.scorecard["axes"]
    steps = max((len(axis["levels"]) for axis in axes), default=1)
    card = _card(score, protocol)
    heights = [0.19 * len(_head(score)) + 0.15, _ROW_IN * max(1, len(axes)) + 0.7, _LINE_IN * (len(card) + 2)]
    figure = new_figure("page", sum(heights))
    parts: Any = figure.subfigures(3, 1, height_ratios=heights)
    head, chart, foot = parts
    plot = chart.add_subplot()
    for row, axis in enumerate(axes):
        _draw_levels(plot, row, axis, steps)
    everyone = [score, *others]
    for place, (who, colour) in enumerate(zip(everyone, colours(len(everyone)), strict=True)):
        mark = MARKS[place % len(MARKS)]
        _draw_marks(plot, who, axes, steps, _LEFT + _APART * place, mark, colour, first=place == 0)
    _finish(plot, axes, steps)
    plot.legend(loc="lower center", bbox_to_anchor=(0.4, 1.0), ncols=4, frameon=False, fontsize=8.0)
    _write(head.add_subplot(), _head(score))
    _write_card(foot.add_subplot(), card)
    return figure


def _head(score: Score) -> list[str]:
    """Who it is, and the sentence."""
    content = score.content
    seeds = f"round {content['seeds']['round']}" if content["seeds"]["round"] else "development seeds"
    arms = ", ".join(content["arms"])
    draft = " (draft)" if content["draft"] else ""
    first = f"{score.name}: robustness passport"
    second = f"{content['protocol']}{draft}, track {content['track']}, {arms}, {seeds}"
    return [first, second, *(line for text in sentence(score)[:2] for line in wrap(text, 115))]


def _card(score: Score, protocol: ProtocolConfig) -> list[tuple[str, str, str]]:
    """Label, value and interval of each number of the scorecard."""
    card = score.scorecard
    rows = [(figure.label, *figure_told(card["figures"][name])) for name, figure in protocol.figures.items()]
    rows.append(("ticks later than their period, on this machine", timing_told(score), ""))
    rows.append(("tuning budget spent", tuning_told(card["tuning"]), ""))
    return rows


def _write(place: "Axes", lines: Sequence[str]) -> None:
    """Lines of text from the top, the first in bold."""
    place.axis("off")
    for number, line in enumerate(lines):
        weight, size = ("bold", 11.0) if number == 0 else ("normal", 8.0)
        place.text(0.0, 1.0 - number / len(lines), line, va="top", weight=weight, fontsize=size)


def _write_card(place: "Axes", rows: Sequence[tuple[str, str, str]]) -> None:
    """The scorecard in three columns."""
    place.axis("off")
    for number, (label, value, interval) in enumerate([("scorecard", "value", "95 %"), *rows]):
        height, weight = 1.0 - number / (len(rows) + 1), "bold" if number == 0 else "normal"
        for x, text, side in ((0.0, label, "left"), (0.6, value, "right"), (0.63, interval, "left")):
            place.text(x, height, text, va="top", ha=side, weight=weight, fontsize=7.5)


def _draw_levels(plot: "Axes", row: int, axis: Mapping[str, Any], steps: int) -> None:
    """A box for each level with its value, growing darker; the last one says that all are held."""
    levels = axis["levels"]
    for place, level in enumerate(levels):
        shade = 0.97 - 0.14 * place / max(1, steps - 1)
        plot.barh(row, 0.96, left=place - 0.48, height=0.86, color=str(shade), zorder=0)
        text = "unchanged" if level["level"] is None else f"{level['level']:g}"
        plot.text(place + 0.44, row + 0.36, text, ha="right", va="bottom", fontsize=6.0, color="0.25")
    plot.barh(
        row, 0.96, left=steps - 0.48, height=0.86, color="white", edgecolor="0.6", linewidth=0.5, zorder=0
    )


def _draw_marks(
    plot: "Axes",
    who: Score,
    axes: Sequence[Mapping[str, Any]],
    steps: int,
    offset: float,
    mark: str,
    colour: str,
    *,
    first: bool,
) -> None:
    own = {(axis["generator"], axis["axis"]): axis["first_failing"] for axis in who.scorecard["axes"]}
    rows: list[float] = []
    places: list[float] = []
    for row, axis in enumerate(axes):
        key = (axis["generator"], axis["axis"])
        if key in own:
            rows.append(row - _RAISED)
            places.append(offset + (steps if own[key] is None else own[key]))
    if first:
        for height, place in zip(rows, places, strict=True):
            plot.plot([-0.48, place], [height, height], color=colour, linewidth=1.4, zorder=1)
    plot.plot(
        places,
        rows,
        linestyle="none",
        marker=mark,
        markersize=6.5 if first else 4.5,
        color=colour,
        markerfacecolor=colour if first else "white",
        label=who.name,
        zorder=3 if first else 2,
    )


def _finish(plot: "Axes", axes: Sequence[Mapping[str, Any]], steps: int) -> None:
    plot.set_yticks(range(len(axes)), [axis["label"] for axis in axes])
    plot.set_ylim(len(axes) - 0.45, -0.55)
    plot.set_xlim(-0.5, steps + 0.5)
    plot.set_xticks(
        [0, (steps - 1) / 2.0 + 0.5, steps], ["fails unchanged", "first failing level", "holds all"]
    )
    plot.tick_params(length=0.0)
    for side in ("left", "bottom"):
        plot.spines[side].set_visible(False)
