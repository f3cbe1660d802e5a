"""Which signals share a plot, and how a plot looks."""

import numpy as np
import rerun.blueprint as rrb

from surgsim.columns import Block
from surgsim.recording.layout import ERRORS, KEY, LIMITS, series_path
from surgsim.trace.trace import Trace, base_blocks

_TERM = "tau_"
_TITLES = {
    "n": "Force [N]",
    "j": "Energy [J]",
    "m": "Position [m]",
    "m_per_s": "Velocity [m/s]",
    "rad": "Angle [rad]",
    "s": "Time [s]",
    "": "States and counts",
}
_NOT_PLOTTED = "_quat"  # ends the name of an orientation: it is in the scene
_ROWS_AT_ONCE = 500
_LEGEND_ROOM = 0.55  # empty time after the end, as a share of the run, in which a legend is off the data


def plot(
    name: str,
    *paths: str,
    axis_x: rrb.TimeAxis | None = None,
    axis_y: rrb.ScalarAxis | None = None,
    legend: bool = False,
) -> rrb.TimeSeriesView:
    """A plot of the series at `paths`, scaled to them; pointing at it names each series and its value."""
    return rrb.TimeSeriesView(
        name=name,
        origin="/",
        contents=[f"+ /{path}" for path in paths],
        axis_x=axis_x,
        axis_y=axis_y,
        plot_legend=rrb.PlotLegend(visible=legend, corner=rrb.Corner2D.RightTop),
        interaction=rrb.PlotInteraction(tooltip_mode="All"),
    )


def errors_plot(
    below: str = "", axis_y: rrb.ScalarAxis | None = None, name: str = "Tip blue, RCM orange [mm]"
) -> rrb.TimeSeriesView:
    """Both errors [mm]."""
    return plot(name, f"{below}{ERRORS}", axis_y=axis_y)


def joint_plots(trace: Trace, below: str = "") -> list[rrb.Tabs]:
    """Positions, velocities and torques: scaled to the data first, with the limits in a tab of its own."""
    tabs = []
    for block, title, other, other_title in (
        ("q", "Joint position [rad]", "q_ref", "Reference"),
        ("v", "Joint velocity [rad/s]", "qdot_ref", "Command"),
        ("tau", "Torque [N m]", "", ""),
    ):
        path, limits = f"{below}{series_path(block)}", f"{below}{LIMITS}/{block}"
        views = [plot(title, path), plot("With limits, grey", path, limits)]
        views += [plot(other_title, f"{below}{series_path(other)}")] if other else _terms(trace, below)
        tabs.append(rrb.Tabs(*views, active_tab=0))
    return tabs


def _terms(trace: Trace, below: str) -> list[rrb.TimeSeriesView]:
    """A plot for every term of the torque law that acts."""
    terms = [block for block in _added(trace) if block.name.startswith(_TERM)]
    return [
        plot(f"of {block.name.strip('_').removeprefix(_TERM)}", f"{below}{series_path(block.name)}")
        for block in terms
    ]


def joint_key(joints: int, below: str = "") -> rrb.Spatial2DView:
    """Which colour is which joint, once for all plots."""
    return rrb.Spatial2DView(
        name=f"Joints 1 to {joints}",
        origin=f"/{below}{KEY}",
        visual_bounds=rrb.VisualBounds2D(x_range=(0.4, joints + 0.6), y_range=(-0.3, 0.5)),
    )


def controller_plots(trace: Trace) -> list[rrb.TimeSeriesView]:
    """Manipulability, the controller's time and residual, saturation if there is any."""
    views = [
        plot("Manipulability", series_path("manipulability")),
        plot("6-D", series_path("manipulability_6d")),
        _control_time_plot(trace),
        plot("Deadline, grey", series_path("control_time"), f"{LIMITS}/control_time"),
        plot("Resolver residual [m/s]", series_path("resolver_residual")),
    ]
    if varies(trace, "saturated_joints"):
        views.append(plot("Saturated joints", series_path("saturated_joints")))
    return views


def _control_time_plot(trace: Trace) -> rrb.TimeSeriesView:
    """Scaled to nearly all ticks, not to the one slow first tick."""
    times = trace["control_time_s"]
    times = times[np.isfinite(times)]
    top = 1.5 * float(np.quantile(times, 0.99)) if len(times) else 0.0
    axis = rrb.ScalarAxis(range=(0.0, top)) if top > 0.0 else None
    return plot("Control time [s]", series_path("control_time"), axis_y=axis)


def added_plots(trace: Trace, until_s: float | None = None) -> list[rrb.TimeSeriesView]:
    """What task, controller and plant add: one plot for every unit, its legend to the right of the data."""
    axis = _with_room(trace, until_s)
    return [
        plot(
            _TITLES.get(unit, f"[{unit}]"),
            *(series_path(block.name) for block in blocks),
            axis_x=axis,
            legend=True,
        )
        for unit, blocks in groups(trace).items()
    ]


def _with_room(trace: Trace, until_s: float | None) -> rrb.TimeAxis:
    """The run's time, and some after it for a legend."""
    first, last = float(trace["t_s"][0]), float(trace["t_s"][-1] if until_s is None else until_s)
    ends = (first, last + _LEGEND_ROOM * (last - first))
    start, end = (rrb.TimeRangeBoundary.absolute(seconds=t) for t in ends)
    return rrb.TimeAxis(view_range=rrb.TimeRange(start=start, end=end))


def groups(trace: Trace) -> dict[str, list[Block]]:
    """By unit the added blocks that vary over the run and are neither a torque's terms nor orientations."""
    found: dict[str, list[Block]] = {}
    for block in _added(trace):
        if not (block.name.startswith(_TERM) or block.name.endswith(_NOT_PLOTTED)):
            found.setdefault(block.unit, []).append(block)
    order = [*_TITLES, *found]
    return {unit: found[unit] for unit in sorted(found, key=order.index)}


def _added(trace: Trace) -> list[Block]:
    return [block for block in trace.blocks[len(base_blocks(trace.joints)) :] if varies(trace, block.name)]


def varies(trace: Trace, block: str) -> bool:
    """Whether a block has two different numbers in any of its columns."""
    values = trace.block(block)
    lowest = highest = values[0]
    for first in range(0, len(values), _ROWS_AT_ONCE):  # most that vary do so at once
        rows = values[first : first + _ROWS_AT_ONCE]
        lowest, highest = np.fmin(lowest, np.fmin.reduce(rows)), np.fmax(highest, np.fmax.reduce(rows))
        if (highest > lowest).any():
            return True
    return False
