"""The signals that the viewer plots: the trace's columns, the errors in millimetres, and the limits.

They are for the eye: `polyline` chooses which rows are drawn. The whole trace is packed in the header.
"""

from collections.abc import Sequence
from itertools import cycle, islice

import numpy as np
import rerun as rr

from surgsim.array import Array
from surgsim.columns import Block
from surgsim.recording import palette
from surgsim.recording.below import Below
from surgsim.recording.layout import ERRORS, KEY, LIMITS, TIMELINE, Durations, series_path, timestamps
from surgsim.recording.plots import groups
from surgsim.recording.polyline import drawn_rows
from surgsim.trace.trace import Trace

_SCALAR_COLORS = {
    "manipulability_6d": [palette.ORANGE],
    "rcm_error": [palette.ORANGE],
    "saturated_joints": [palette.VERMILION],
}


def log_signals(stream: rr.RecordingStream | Below, trace: Trace) -> None:
    """Send every block but the time, then what is derived for the plots.

    A piece of a run may be sent after the other.
    """
    times = timestamps(trace["t_s"])
    colors = series_colors(trace)
    for block in trace.blocks[1:]:
        values = trace.block(block.name)
        _draw(stream, series_path(block.name), times, values, names=_names(block), colors=colors[block.name])
    errors = 1e3 * np.stack([trace["tip_error_m"], trace["rcm_error_m"]], axis=1)
    _draw(stream, ERRORS, times, errors, names=["tip", "RCM"], colors=[palette.SKY, palette.ORANGE])
    _log_limits(stream, trace)
    _log_key(stream, trace.joints)


def _draw(
    stream: rr.RecordingStream | Below,
    path: str,
    times: Durations,
    values: Array,
    *,
    names: Sequence[str],
    colors: Sequence[tuple[int, int, int]],
) -> None:
    """Send those rows of `values` (rows, series) that show them."""
    rows = drawn_rows(values)
    columns = [rr.TimeColumn(TIMELINE, duration=times[rows])]
    _send(stream, path, columns, values[rows], names=names, colors=colors)


def _send(
    stream: rr.RecordingStream | Below,
    path: str,
    times: list[rr.TimeColumn],
    values: Array,
    *,
    names: Sequence[str],
    colors: Sequence[tuple[int, int, int]],
    width: float = 1.5,
) -> None:
    """One entity with a series for every column of `values` (rows, series)."""
    widths = [width] * len(names)
    stream.log(path, rr.SeriesLines(names=list(names), colors=list(colors), widths=widths), static=True)
    columns = rr.Scalars.columns(scalars=np.ascontiguousarray(values).ravel())
    stream.send_columns(path, times, columns.partition([values.shape[1]] * len(values)))


def _names(block: Block) -> list[str]:
    """The columns' names without the unit, e.g. `q1`."""
    return [column.removesuffix(f"_{block.unit}") for column in block.columns]


def series_colors(trace: Trace) -> dict[str, list[tuple[int, int, int]]]:
    """Colours of every block's series; those that share a plot take turns."""
    found = {block.name: [*islice(cycle(palette.SERIES), len(block.labels))] for block in trace.blocks}
    found |= {name: [palette.SKY] for name, colors in found.items() if len(colors) == 1} | _SCALAR_COLORS
    for blocks in groups(trace).values():
        turn = cycle(palette.SERIES)
        found |= {block.name: [*islice(turn, len(block.labels))] for block in blocks}
    return found


def _log_key(stream: rr.RecordingStream | Below, count: int) -> None:
    """A point and a number for every joint, in its colour."""
    joints = range(1, count + 1)
    points = rr.Points2D(
        [(joint, 0.0) for joint in joints],
        colors=[*islice(cycle(palette.SERIES), count)],
        labels=[str(joint) for joint in joints],
        radii=rr.Radius.ui_points(5.0),
        show_labels=True,
    )
    stream.log(KEY, points, static=True)


def _log_limits(stream: rr.RecordingStream | Below, trace: Trace) -> None:
    """A grey line from start to end for every distinct limit, named after its joints."""
    limits = {name: np.array(values) for name, values in trace.meta.limits.items()}
    ends = timestamps(trace["t_s"][[0, -1]] if len(trace) > 1 else trace["t_s"])
    times = [rr.TimeColumn(TIMELINE, duration=ends)]
    for name, lines in (
        ("q", _distinct("max", limits["q_max"]) + _distinct("min", limits["q_min"])),
        ("v", _distinct("max", limits["velocity"]) + _distinct("min", -limits["velocity"])),
        ("tau", _distinct("max", limits["torque"]) + _distinct("min", -limits["torque"])),
        ("control_time", [("control period", trace.meta.control_period_s)]),
    ):
        values = np.tile([value for _, value in lines], (len(ends), 1))
        _send(
            stream,
            f"{LIMITS}/{name}",
            times,
            values,
            names=[label for label, _ in lines],
            colors=[palette.GREY] * len(lines),
            width=1.0,
        )


def _distinct(word: str, values: Array) -> list[tuple[str, float]]:
    """Name and value of every distinct limit, e.g. `max 1 3 5 7`."""
    return [
        (f"{word} {' '.join(str(i + 1) for i in np.flatnonzero(values == value))}", float(value))
        for value in dict.fromkeys(values.tolist())
    ]
