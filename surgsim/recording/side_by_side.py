"""Two recordings as one: side by side on one timeline."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun.blueprint as rrb

from surgsim.array import Array
from surgsim.recording.below import Below, by_arm
from surgsim.recording.blueprint import laid_out, texts_view
from surgsim.recording.eyes import inside_view, scene_view
from surgsim.recording.layout import series_path
from surgsim.recording.plots import errors_plot, joint_key, joint_plots, plot
from surgsim.recording.read import Recorded
from surgsim.recording.scene import log_scene, scenario_of
from surgsim.recording.signals import log_signals
from surgsim.recording.stream import stream_to
from surgsim.recording.write import log_texts
from surgsim.trace.trace import Trace

_SIDES = ("a", "b")
_MARGIN = 0.05  # above and below the signals, as a share of their range


def write_pair(path: Path, pair: Sequence[Recorded]) -> None:
    """Write two runs into one recording, each below an entity of its own, with a layout of two columns.

    Raises:
        SurgsimError: If the file cannot be written.
    """
    traces = [recorded.trace for recorded in pair]
    with stream_to(path, _blueprint(traces)) as stream:
        stream.send_recording_name(" | ".join(title(trace) for trace in traces))
        for side, recorded in zip(_SIDES, pair, strict=True):
            below, trace = Below(stream, side), recorded.trace
            for where, one in by_arm(below, trace):
                log_signals(where, one)
            log_scene(below, scenario_of(trace), trace)
            log_texts(below, trace.meta, recorded.metrics)


def title(trace: Trace) -> str:
    """Controller, scenario and seed of a run."""
    scenario = trace.meta.scenario
    return f"{trace.meta.controller} · {scenario['name']} · seed {scenario['seed']}"


def _blueprint(traces: Sequence[Trace]) -> rrb.Blueprint:
    each = [one for trace in traces for one in trace.each()]
    errors = common_axis([1e3 * one[name] for one in each for name in ("tip_error_m", "rcm_error_m")])
    manipulability = common_axis([one["manipulability"] for one in each])
    columns = [
        _column(f"{side}/", trace, errors, manipulability) for side, trace in zip(_SIDES, traces, strict=True)
    ]
    return laid_out(rrb.Horizontal(*columns))


def common_axis(signals: Sequence[Array]) -> rrb.ScalarAxis | None:
    """An axis that holds all of the signals, so that plots side by side compare; None if none is finite."""
    finite = np.concatenate([signal[np.isfinite(signal)] for signal in signals])
    if not finite.size:
        return None
    low, high = float(finite.min()), float(finite.max())
    margin = _MARGIN * max(high - low, 1e-9)
    return rrb.ScalarAxis(range=(low - margin, high + margin))


def _column(
    below: str, trace: Trace, errors: rrb.ScalarAxis | None, manipulability: rrb.ScalarAxis | None
) -> rrb.Vertical:
    """Scene, errors, manipulability, torques and texts of one run."""
    scenario = scenario_of(trace)
    named = list(zip(trace.arms or ("",), trace.each(), strict=True))
    rows = [_signals(below, arm, one, errors, manipulability) for arm, one in named]
    arm, most = max(named, key=lambda each: each[1].joints)
    return rrb.Vertical(
        rrb.Horizontal(
            scene_view(scenario, trace, below=below, name=title(trace)),
            inside_view(scenario, trace, below=below),
        ),
        *rows,
        joint_key(most.joints, f"{below}{arm}/" if arm else below),
        texts_view(below),
        row_shares=[0.42, *(0.27 / len(rows) for _ in rows), 0.07, 0.24],
    )


def _signals(
    side: str, arm: str, trace: Trace, errors: rrb.ScalarAxis | None, manipulability: rrb.ScalarAxis | None
) -> rrb.Horizontal:
    """Errors, manipulability and torques of an arm of one run."""
    below, of = (f"{side}{arm}/", f"{arm}: ") if arm else (side, "")
    return rrb.Horizontal(
        errors_plot(below, errors, name=f"{of}Tip blue, RCM orange [mm]"),
        plot(f"{of}Manipulability", f"{below}{series_path('manipulability')}", axis_y=manipulability),
        joint_plots(trace, below)[-1],
    )
