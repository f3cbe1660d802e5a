"""Figures 4 to 8 of the paper, each nominal and with payload and friction."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from surgsim.studies.figure import BLACK, BLUE, GREEN, ORANGE, PURPLE, VERMILLION, Axes, figure, legend_below
from surgsim.studies.vprnn.cases import (
    METHODS,
    NOMINAL,
    PAPER_SIZE,
    RCM_BOUND_MM,
    TIP_BOUND_MM,
    Level,
)
from surgsim.studies.vprnn.comparison import Runs, attainable
from surgsim.trace.trace import Trace

_LEVELS = (NOMINAL, PAPER_SIZE)
_TIME = "time (s)"
_EVERY = 10
"""Rows between points that are drawn; 10 ms."""


def draw_comparison(runs: Runs, out: Path) -> tuple[str, ...]:
    """Draw figures 4 to 8 into the folder `out`; gives the files' names."""
    figures: dict[str, Callable[[Runs, Path], None]] = {
        "figure_04.png": _tracking,
        "figure_05.png": _tip_error,
        "figure_06.png": _rcm_error,
        "figure_07.png": _manipulability,
        "figure_08.png": _joints,
    }
    for name, make in figures.items():
        make(runs, out / name)
    return tuple(figures)


def _each(ax: Axes, runs: Runs, level: Level, values: Callable[[Trace], np.ndarray]) -> None:
    for name, method in METHODS.items():
        trace = runs[name, level]
        ax.plot(
            trace["t_s"][::_EVERY],
            values(trace)[::_EVERY],
            color=method.colour,
            linestyle=method.style,
            linewidth=1.6,
            label=method.label,
        )


def _tracking(runs: Runs, out: Path) -> None:
    with figure(out, "Figure 4: trajectory tracking", 2, 2, size=(12.5, 7.0), sharex=True) as axes:
        for row, level in zip(axes, _LEVELS, strict=True):
            wanted = 1e3 * runs["vprnn", level].block("tip_ref")
            start = wanted[0]
            for ax, i, name in ((row[0], 1, "y"), (row[1], 2, "z")):
                ax.plot(*(wanted - start)[:, [0, i]].T, color="0.75", linewidth=5.0, label="desired")
                for key, method in METHODS.items():
                    tip = 1e3 * runs[key, level].block("tip") - start
                    line = {"color": method.colour, "linestyle": method.style, "linewidth": 1.6}
                    ax.plot(*tip[:, [0, i]].T, label=method.label, **line)
                ax.set(title=level.name, ylabel=f"{name} from the start (mm)")
            row[1].set_ylim(-4.0, 1.0)
        for ax in axes[-1]:
            ax.set_xlabel("x from the start (mm)")
        legend_below(axes, 6)


def _tip_error(runs: Runs, out: Path) -> None:
    title = r"Figure 5: end-effector error $E_\mathrm{end}$"
    _error(runs, out, title, "tip error (mm)", lambda trace: 1e3 * trace["tip_error_m"], TIP_BOUND_MM)


def _rcm_error(runs: Runs, out: Path) -> None:
    title = r"Figure 6: RCM error $\|E_\mathrm{rcm}\|$"
    _error(runs, out, title, "RCM error (mm)", lambda trace: 1e3 * trace["rcm_error_m"], RCM_BOUND_MM)


def _error(
    runs: Runs, out: Path, title: str, label: str, values: Callable[[Trace], np.ndarray], bound: float
) -> None:
    with figure(out, f"{title} (logarithmic)", 1, 2, size=(11.5, 5.0), sharex=True, sharey=True) as axes:
        for ax, level in zip(axes.flat, _LEVELS, strict=True):
            _each(ax, runs, level, values)
            ax.axhline(bound, color="0.3", linewidth=1.2, linestyle=(0, (1, 1)))
            ax.text(0.2, 1.12 * bound, f"the paper's bound, {bound:g} mm", color="0.3", fontsize=9.5)
            ax.set(yscale="log", title=level.name, xlabel=_TIME, ylim=(1e-5, 60.0))
        axes[0, 0].set_ylabel(label)
        legend_below(axes, 5)


def _manipulability(runs: Runs, out: Path) -> None:
    title = "Figure 7: manipulability µ, and the largest that self-motion could reach"
    with figure(out, title, 1, 2, size=(11.5, 5.0), sharex=True, sharey=True) as axes:
        for ax, level in zip(axes.flat, _LEVELS, strict=True):
            ax.plot(
                *attainable(runs["self_motion", level]),
                color=BLACK,
                linewidth=4.0,
                alpha=0.25,
                label="attainable µ*",
            )
            _each(ax, runs, level, lambda trace: trace["manipulability"])
            ax.set(title=level.name, xlabel=_TIME)
        axes[0, 0].set_ylabel("manipulability µ (m³)")
        legend_below(axes, 6)


def _joints(runs: Runs, out: Path) -> None:
    colours = (BLACK, ORANGE, "#56B4E9", GREEN, VERMILLION, BLUE, PURPLE)
    styles = ("-", "--", "-.", ":", "-", "--", "-.")
    with figure(out, "Figure 8: joint angles with VPRNN", 1, 2, size=(11.5, 5.0), sharey=True) as axes:
        for ax, level in zip(axes.flat, _LEVELS, strict=True):
            trace = runs["vprnn", level]
            for i, q in enumerate(np.rad2deg(trace.block("q")).T):
                ax.plot(
                    trace["t_s"][::_EVERY],
                    q[::_EVERY],
                    styles[i],
                    color=colours[i],
                    linewidth=1.8,
                    label=f"q{i + 1}",
                )
            ax.set(title=level.name, xlabel=_TIME)
        axes[0, 0].set_ylabel("joint angle (deg)")
        legend_below(axes, 7)
