"""Figures of the comparison: tank, passivity controller and nothing, over time and over the delay."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from surgsim.studies.figure import BLACK, Axes, figure, legend_below
from surgsim.studies.passive_teleoperation.cases import COLOURS, GRIPS, PASSIVITY, Push
from surgsim.studies.passive_teleoperation.runs import Done
from surgsim.studies.passive_teleoperation.stability import REST_MM_PER_S, UNSTABLE
from surgsim.studies.study import Row
from surgsim.studies.vprnn.cells import number, pick

_ROWS = (
    ("force", 1.0, "contact force (N)"),
    ("felt", 1.0, "force on the handle (N)"),
    ("handle_speed", 1e3, "speed of the handle (mm/s)"),
    ("delivered", 1.0, "energy delivered (J)"),
)
_STYLES = {"tank": "-", "tdpa": "-", "off": "--"}
_WIDTHS = {"tank": 2.4, "tdpa": 0.7, "off": 1.2}
_STEPS = {"tank": -1, "tdpa": 0, "off": 1}
_OFFSET_MS = 12.0


def draw_comparison(pushes: Sequence[Done], out: Path) -> None:
    """The wall at 300 ms over time: forces, handle speed and energy, one column for each grip."""
    shown = [done for done in pushes if done.curves is not None and _is_wall(done)]
    title = "Push on a stiff wall, 300 ms round trip"
    with figure(out, title, len(_ROWS), len(GRIPS), size=(11.0, 11.0), sharex="col") as axes:
        for done in sorted(shown, key=_tdpa_first):
            _comparison_column(axes, done)
        for ax, grip in zip(axes[0], GRIPS, strict=True):
            ax.set_title(f"{grip} grip")
        for ax, (name, _, words) in zip(axes[:, 0], _ROWS, strict=True):
            ax.set_ylabel(words + (", symlog" if name == "delivered" else ""))
        for ax in axes[2]:
            ax.set_ylim(bottom=0.1)
        for ax in axes[-1]:
            ax.set_xlabel("time (s)")
        legend_below(axes, 3)


def _tdpa_first(done: Done) -> bool:
    """The passivity controller's chatter is drawn below the others."""
    return isinstance(done.case, Push) and done.case.passivity != "tdpa"


def _is_wall(done: Done) -> bool:
    return isinstance(done.case, Push) and done.case.place == "wall"


def _comparison_column(axes: Axes, done: Done) -> None:
    assert isinstance(done.case, Push)
    assert done.curves is not None
    name, column = done.case.passivity, GRIPS.index(done.case.grip)
    for ax, (key, factor, _) in zip(axes[:, column], _ROWS, strict=True):
        ax.plot(
            done.curves["t"],
            factor * done.curves[key],
            _STYLES[name],
            color=COLOURS[name],
            label=name,
            linewidth=_WIDTHS[name],
        )
        if key == "delivered":
            ax.set_yscale("symlog", linthresh=0.1)
        if key == "handle_speed":
            ax.set_yscale("log")


def draw_sweep(rows: Sequence[Row], out: Path) -> None:
    """The wall over the delay: handle speed at the end and energy delivered; crosses are unstable."""
    wall = pick(rows, place="wall")
    columns = (
        ("handle_speed_end_mm_per_s", "handle speed at the end (mm/s)"),
        ("delivered_max_j", "largest energy delivered (J)"),
    )
    title = "Push on a stiff wall over the round trip: dots settle, crosses do not; hollow: jitter and loss"
    with figure(out, title, 2, 2, size=(11.0, 8.0), sharex=True, sharey="row") as axes:
        for line, (column, words) in zip(axes, columns, strict=True):
            for ax, grip in zip(line, GRIPS, strict=True):
                for passivity in PASSIVITY:
                    _sweep_points(ax, pick(wall, grip=grip, passivity=passivity), column, passivity)
            line[0].set_ylabel(words)
        for ax, grip in zip(axes[0], GRIPS, strict=True):
            ax.set(title=f"{grip} grip", yscale="log")
            ax.axhline(REST_MM_PER_S, color=BLACK, linewidth=1.0, linestyle=":")
        for ax in axes[1]:
            ax.set_yscale("symlog", linthresh=1e-2)
            ax.axhline(0.4, color=BLACK, linewidth=1.0, linestyle=":")
            ax.set(xlabel="round trip (ms)", ylim=(-0.01, 20.0))
        legend_below(axes, 3)


def _sweep_points(ax: Axes, rows: Sequence[Row], column: str, passivity: str) -> None:
    shift = _OFFSET_MS * _STEPS[passivity]
    clean = pick(rows, link="clean")
    points = np.array([(number(row, "delay_ms") + shift, number(row, column)) for row in clean]).T
    ax.plot(*points, _STYLES[passivity], color=COLOURS[passivity], linewidth=1.3, label=passivity)
    for row in rows:
        marker = "X" if row["end"] in UNSTABLE else "o"
        fill = COLOURS[passivity] if row["link"] == "clean" else "none"
        place = (number(row, "delay_ms") + shift, number(row, column))
        ax.plot(*place, marker, markerfacecolor=fill, markeredgecolor=COLOURS[passivity], markersize=7)
