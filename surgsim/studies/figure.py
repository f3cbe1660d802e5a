"""How the studies' figures look: one style, colours that differ for every kind of colour vision."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

VERMILLION, BLUE, GREEN, PURPLE, ORANGE, BLACK = (
    "#D55E00",
    "#0072B2",
    "#009E73",
    "#CC79A7",
    "#E69F00",
    "#000000",
)
"""Colours of Okabe and Ito."""

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
