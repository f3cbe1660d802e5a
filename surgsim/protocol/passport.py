"""The robustness passport as a chart: how far a controller gets along every axis, beside others."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from surgsim.export.paper_style import colours, new_figure
from surgsim.protocol.score import Score

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKS = ("o", "s", "^", "D", "v", "P", "X")
"""Shapes tell controllers apart where colours do not print."""
_ROW_IN = 0.42
_HEAD_IN = 1.1
_SPREAD = 0.24


def passport_figure(score: Score, others: Sequence[Score]) -> "Figure":
    """A row for each axis: its levels from easy to hard, and where each controller fails first.

    A mark stands at the first level that fails; one that holds all of them stands at the right end.
    """
    axes = score.scorecard["axes"]
    figure = new_figure("page", _HEAD_IN + _ROW_IN * max(1, len(axes)))
    plot = figure.add_subplot()
    steps = max((len(axis["levels"]) for axis in axes), default=1)
    for row, axis in enumerate(axes):
        _draw_levels(plot, row, axis, steps)
    everyone = [score, *others]
    offsets = _offsets(len(everyone))
    for place, (who, colour) in enumerate(zip(everyone, colours(len(everyone)), strict=True)):
        _draw_marks(
            plot, who, axes, steps, offsets[place], MARKS[place % len(MARKS)], colour, first=place == 0
        )
    _finish(plot, axes, steps)
    handles, labels = plot.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=4, frameon=False, fontsize=8.0)
    return figure


def _offsets(count: int) -> list[float]:
    """Where in its row each controller's mark stands, the first above."""
    if count == 1:
        return [0.0]
    return [-_SPREAD + 2.0 * _SPREAD * place / (count - 1) for place in range(count)]


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
    places: list[int] = []
    for row, axis in enumerate(axes):
        key = (axis["generator"], axis["axis"])
        if key in own:
            rows.append(row + offset)
            places.append(steps if own[key] is None else own[key])
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
