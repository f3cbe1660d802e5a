"""The figure of a run: the tip's path, and both errors over time."""

import io
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from surgsim.array import Array
from surgsim.columns import AXES
from surgsim.display import number
from surgsim.studies.figure import BLACK, BLUE, ORANGE, VERMILLION
from surgsim.trace.trace import Trace

if TYPE_CHECKING:
    from surgsim.api.run import Run


_MM = 1e3
_NEAR = 0.5
"""Share of a limit above which it is drawn."""


class RunFigure(Figure):
    """A matplotlib figure that notebooks show without pyplot."""

    def _repr_png_(self) -> bytes:
        stream = io.BytesIO()
        self.savefig(stream, format="png", dpi=110)
        return stream.getvalue()


def figure_of(run: "Run") -> Figure:
    """Three axes: the path in the plane of its largest extent, tip error and RCM error over time [mm, s]."""
    figure = RunFigure(figsize=(10.0, 4.6), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(f"{run.name}, {run.controller}, seed {run.seed}: {run.outcome}", fontsize=12)
    axes: dict[str, Any] = figure.subplot_mosaic([["path", "tip"], ["path", "rcm"]], width_ratios=[1.0, 1.5])
    for ax in axes.values():
        ax.grid(visible=True, color="0.9", linewidth=0.8)
        ax.set_axisbelow(True)
        ax.spines[["top", "right"]].set_visible(False)
    trace, safety = run.trace, run.scenario.safety
    _path(axes["path"], trace)
    _error(axes["tip"], trace, "tip error", trace["tip_error_m"], BLUE, safety.tip_error_max_m)
    _error(axes["rcm"], trace, "RCM error", trace["rcm_error_m"], VERMILLION, safety.rcm_error_max_m)
    axes["tip"].sharex(axes["rcm"])
    axes["tip"].tick_params(labelbottom=False)
    axes["rcm"].set_xlabel("time [s]")
    return figure


def _path(ax: Any, trace: Trace) -> None:
    """Commanded and travelled path from above or from the side, whichever shows more of it."""
    tip, wanted = trace.block("tip") * _MM, trace.block("tip_ref") * _MM
    known = wanted[np.isfinite(wanted).all(axis=1)]
    shown = known if len(known) else tip
    middle = (shown.max(axis=0) + shown.min(axis=0)) / 2.0
    across, up = sorted(np.argsort(np.ptp(shown, axis=0), kind="stable")[1:].tolist())
    ax.plot(*(wanted - middle)[:, [across, up]].T, color=ORANGE, linewidth=4.0, label="path commanded")
    ax.plot(*(tip - middle)[:, [across, up]].T, color=BLACK, linewidth=1.0, label="path of the tip")
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.12)
    ax.set_xlabel(f"{AXES[across]} [mm]")
    ax.set_ylabel(f"{AXES[up]} [mm]")
    ax.legend(frameon=False, fontsize=10, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)


def _error(ax: Any, trace: Trace, name: str, error: Array, colour: str, limit: float | None) -> None:
    """An error over time, with the limit that ends the run where the error comes near it."""
    values = error * _MM
    ax.plot(trace["t_s"], values, color=colour, linewidth=1.2)
    ax.set_ylabel(f"{name} [mm]")
    if not np.isfinite(values).any():
        ax.text(0.5, 0.5, "not defined in this run", transform=ax.transAxes, ha="center", color="0.4")
        ax.set_yticks([])
        return
    largest = float(np.nanmax(values))
    ax.set_ylim(0.0, 1.1 * largest if largest > 0.0 else 1.0)
    ax.set_title(f"largest {number(largest, 3)} mm{_limit(ax, largest, limit)}", loc="left", fontsize=11)


def _limit(ax: Any, largest: float, limit: float | None) -> str:
    """Draw the limit if it is near, and say it."""
    if limit is None:
        return ""
    if largest > _NEAR * limit * _MM:
        ax.axhline(limit * _MM, color=BLACK, linewidth=1.0, linestyle="--")
        ax.set_ylim(0.0, 1.1 * max(largest, limit * _MM))
    return f", limit {number(limit * _MM, 3)} mm"
