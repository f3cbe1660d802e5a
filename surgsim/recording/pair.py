"""Two recordings as one: side by side on one timeline."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from surgsim.recording.blueprint import plot, scene_view, texts_view
from surgsim.recording.layout import ERRORS, LIMITS, TIMELINE, series_path
from surgsim.recording.read import Recorded
from surgsim.recording.scene import log_scene, scenario_of
from surgsim.recording.signals import log_signals
from surgsim.recording.stream import stream_to
from surgsim.recording.write import log_texts
from surgsim.trace.trace import Trace

_SIDES = ("a", "b")


def write_pair(path: Path, pair: Sequence[Recorded]) -> None:
    """Write two runs into one recording, each below an entity of its own, with a layout of two columns.

    Raises:
        SurgsimError: If the file cannot be written.
    """
    traces = [recorded.trace for recorded in pair]
    with stream_to(path, _blueprint(traces)) as stream:
        stream.send_recording_name(" | ".join(title(trace) for trace in traces))
        for side, recorded in zip(_SIDES, pair, strict=True):
            below, trace = _Below(stream, side), recorded.trace
            log_signals(below, trace)
            log_scene(below, scenario_of(trace), trace)
            log_texts(below, trace.meta, recorded.metrics)


def title(trace: Trace) -> str:
    """Controller, scenario and seed of a run."""
    scenario = trace.meta.scenario
    return f"{scenario['controller']['name']} · {scenario['name']} · seed {scenario['seed']}"


class _Below:
    """A stream that puts every entity below `side`."""

    def __init__(self, stream: rr.RecordingStream, side: str) -> None:
        self._stream = stream
        self._side = side

    def log(self, path: str, *parts: Any, **options: Any) -> None:
        """As the stream's."""
        self._stream.log(f"{self._side}/{path}", *parts, **options)

    def set_time(self, timeline: str, **options: Any) -> None:
        """As the stream's."""
        self._stream.set_time(timeline, **options)

    def send_columns(self, path: str, *parts: Any, **options: Any) -> None:
        """As the stream's."""
        self._stream.send_columns(f"{self._side}/{path}", *parts, **options)


def _blueprint(traces: Sequence[Trace]) -> rrb.Blueprint:
    columns = [_column(side, trace) for side, trace in zip(_SIDES, traces, strict=True)]
    return rrb.Blueprint(
        rrb.Horizontal(*columns),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
        auto_views=False,
    )


def _column(side: str, trace: Trace) -> rrb.Vertical:
    """Scene, errors, manipulability, torques and texts of one run."""
    return rrb.Vertical(
        scene_view(scenario_of(trace), trace, below=f"{side}/", name=title(trace)),
        rrb.Horizontal(
            plot("Tip and RCM error [mm]", f"{side}/{ERRORS}"),
            plot("Manipulability", f"{side}/{series_path('manipulability')}"),
            plot("Torque [N m]", f"{side}/{series_path('tau')}", f"{side}/{LIMITS}/tau"),
        ),
        texts_view(f"{side}/"),
        row_shares=[0.5, 0.3, 0.2],
    )
