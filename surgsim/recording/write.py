"""Writing a recording: the trace without loss, the scene, and the layout of the viewer."""

from collections.abc import Mapping
from pathlib import Path

import pyarrow as pa
import rerun as rr

from surgsim.errors import Outcome
from surgsim.recording.below import by_arm
from surgsim.recording.blueprint import blueprint
from surgsim.recording.encoding import encode
from surgsim.recording.layout import COLUMNS, HEADER, LOG, SEAL, SUMMARY, TIMELINE, Header, seal
from surgsim.recording.scene import log_scene, scenario_of
from surgsim.recording.signals import log_signals
from surgsim.recording.stream import stream_to
from surgsim.recording.summary import outcome_sentence, result_markdown, scenario_markdown
from surgsim.scenario.arms import Experiment
from surgsim.trace.trace import Trace, TraceMeta


def write_recording(path: Path, trace: Trace, metrics: Mapping[str, float | None]) -> None:
    """Write `trace` with its scene as a rerun recording that `read_recording` gives back bit for bit.

    Nothing but the trace is needed: the scene is rebuilt from the scenario in its meta data.

    Args:
        path: File to write, `.rrd`; replaced if it exists, and never left half written.
        trace: The run, of one row at least.
        metrics: Metrics to store and show; None where one does not apply.

    Raises:
        SurgsimError: If the file cannot be written.
    """
    scenario = scenario_of(trace)
    texts = Header.of(trace, metrics).to_texts()
    packed = encode(trace.data)
    sha256 = seal(packed, texts)
    with stream_to(path, blueprint(scenario, trace), recording_id=sha256[:32]) as stream:
        stream.send_recording_name(recording_name(scenario))
        log_header(stream, texts, packed, sha256)
        for where, one in by_arm(stream, trace):
            log_signals(where, one)
        log_scene(stream, scenario, trace)
        log_texts(stream, trace.meta, metrics)


def recording_name(scenario: Experiment) -> str:
    """What the viewer calls a run."""
    return f"{scenario.name} · {scenario.controller_name} · seed {scenario.seed}"


def log_header(stream: rr.RecordingStream, texts: Mapping[str, str], packed: bytes, sha256: str) -> None:
    """Store what the trace is read back from, under the seal."""
    columns = pa.array([packed], pa.large_binary())
    stream.log(HEADER, rr.AnyValues(**texts, **{COLUMNS: columns, SEAL: sha256}), static=True)


def log_texts(stream: rr.RecordingStream, meta: TraceMeta, metrics: Mapping[str, float | None]) -> None:
    """Log how the run ended, its metrics and its scenario."""
    texts = {"result": result_markdown(meta, metrics), "scenario": scenario_markdown(meta)}
    for name, text in texts.items():
        document = rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)
        stream.log(f"{SUMMARY}/{name}", document, static=True)
    level = rr.TextLogLevel.INFO if meta.ending.outcome is Outcome.COMPLETED else rr.TextLogLevel.WARN
    stream.set_time(TIMELINE, duration=meta.ending.t_s)
    stream.log(LOG, rr.TextLog(outcome_sentence(meta), level=level))
