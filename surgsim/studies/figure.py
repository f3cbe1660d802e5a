"""How the studies' figures look: one style, colours that differ for every kind of colour vision."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from surgsim.array import Array
from surgsim.recording import palette

VERMILLION, BLUE, GREEN, PURPLE, ORANGE, BLACK = map(
    palette.hexadecimal,
    (palette.VERMILION, palette.BLUE, palette.GREEN, palette.PINK, palette.ORANGE, palette.BLACK),
)
"""Colours of Okabe and Ito, as matplotlib takes them."""

Axes = Any


@contextmanager
def figure(
    out: Path,
    title: str,
    rows: int = 1,
    columns: int = 1,
    size: tuple[float, float] = (11.0, 4.0),
    **keys: Any,
) -> Iterator[Any]:
    """Axes (rows, columns) of a figure that is written to `out` when the block ends."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    drawing = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(drawing)
    drawing.suptitle(title, fontsize=13)
    axes = drawing.subplots(rows, columns, squeeze=False, **keys)
    for ax in axes.flat:
        ax.grid(visible=True, color="0.9", linewidth=0.8)
        ax.set_axisbelow(True)
        ax.tick_params(labelsize=10)
        for side in ("top", "right"):
            ax.spines[side].set_visible(False)
    yield axes
    for ax in axes.flat:
        ax.xaxis.label.set_size(11)
        ax.yaxis.label.set_size(11)
        ax.title.set_size(11)
    drawing.savefig(out, dpi=110, metadata={"Software": None})


def legend_below(axes: Any, columns: int) -> None:
    """One legend below all axes, of what the first ones show."""
    handles, labels = axes.flat[0].get_legend_handles_labels()
    axes.flat[0].figure.legend(
        handles, labels, loc="outside lower center", ncols=columns, fontsize=10.5, frameon=False
    )


def label(
    axes: Any,
    xlabels: str | Sequence[str] = (),
    ylabels: Sequence[str] = (),
    titles: Sequence[object] = (),
    legend: int = 0,
) -> None:
    """Words at the axes (rows, columns).

    Args:
        axes: The axes.
        xlabels: Below the last row, one for all columns or one for each.
        ylabels: Beside the first column, one for each row.
        titles: Above the axes, row by row.
        legend: Columns of one legend below all axes; none if it is 0.
    """
    below = axes.shape[1] * [xlabels] if isinstance(xlabels, str) else xlabels
    for ax, text in zip(axes[-1], below, strict=False):
        ax.set_xlabel(text)
    for ax, text in zip(axes[:, 0], ylabels, strict=False):
        ax.set_ylabel(text)
    for ax, title in zip(axes.flat, titles, strict=False):
        ax.set_title(str(title))
    if legend:
        legend_below(axes, legend)


def formula(ax: Axes, x: Array, y: Array, label: str) -> None:
    """A dashed curve of a formula, on a logarithmic axis."""
    ax.semilogy(x, y, "--", color=BLACK, linewidth=1.4, label=label)


def heat_map(ax: Axes, values: Array, xs: Sequence[float], ys: Sequence[float], bound: float) -> None:
    """Positive values (ys, xs) as colours and numbers; those up to the bound are boxed."""
    ax.grid(visible=False)
    ax.imshow(np.log(values / bound), cmap="cividis", aspect="auto", origin="lower", vmin=-3.0, vmax=2.0)
    for (i, j), value in np.ndenumerate(values):
        text = f"{value:.1f}" if value < 20.0 else f"{value:.0f}"
        colour = "white" if value < bound else "black"
        box = {"fill": False, "edgecolor": "white", "linewidth": 1.2} if value <= bound else None
        ax.text(j, i, text, ha="center", va="center", fontsize=11, color=colour, bbox=box)
    ax.set_xticks(range(len(xs)), [f"{x:g}" for x in xs])
    ax.set_yticks(range(len(ys)), [f"{y:g}" for y in ys])
