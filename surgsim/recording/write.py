"""Writing a recording: the trace without loss, the scene, and the layout of the viewer."""

from collections.abc import Mapping
from pathlib import Path

import pyarrow as pa
import rerun as rr

from surgsim.errors import Outcome, RecordingError
from surgsim.recording.blueprint import blueprint
from surgsim.recording.encoding import encode
from surgsim.recording.files import replacing
from surgsim.recording.framing import check_framing
from surgsim.recording.layout import APPLICATION, COLUMNS, HEADER, LOG, SEAL, SUMMARY, TIMELINE, Header, seal
from surgsim.recording.scene import log_scene, scenario_of
from surgsim.recording.signals import log_signals
from surgsim.recording.summary import outcome_sentence, result_markdown, scenario_markdown
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
    stream = rr.RecordingStream(APPLICATION, recording_id=sha256[:32], send_properties=False)
    with replacing(path) as temporary:
        stream.save(temporary, default_blueprint=blueprint(scenario, trace))
        stream.send_recording_name(f"{scenario.name} · {scenario.controller.name} · seed {scenario.seed}")
        log_header(stream, texts, packed, sha256)
        log_signals(stream, trace)
        log_scene(stream, scenario, trace)
        log_texts(stream, trace.meta, metrics)
        _finish(stream, temporary, path)


def log_header(stream: rr.RecordingStream, texts: Mapping[str, str], packed: bytes, sha256: str) -> None:
    """Store what the trace is read back from, under the seal."""
    columns = pa.array([packed], pa.large_binary())
    stream.log(HEADER, rr.AnyValues(**texts, **{COLUMNS: columns, SEAL: sha256}), static=True)


def _finish(stream: rr.RecordingStream, temporary: Path, path: Path) -> None:
    """Flush, and make sure that the file is whole: rerun does not always say that the disk is full."""
    try:
        stream.flush()
        stream.disconnect()
        check_framing(temporary)
    except (RuntimeError, RecordingError) as error:
        raise RecordingError(f"{path}: cannot be written whole; is the disk full? ({error})") from error


def log_texts(stream: rr.RecordingStream, meta: TraceMeta, metrics: Mapping[str, float | None]) -> None:
    """Log how the run ended, its metrics and its scenario."""
    texts = {"result": result_markdown(meta, metrics), "scenario": scenario_markdown(meta)}
    for name, text in texts.items():
        document = rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)
        stream.log(f"{SUMMARY}/{name}", document, static=True)
    level = rr.TextLogLevel.INFO if meta.ending.outcome is Outcome.COMPLETED else rr.TextLogLevel.WARN
    stream.set_time(TIMELINE, duration=meta.ending.t_s)
    stream.log(LOG, rr.TextLog(outcome_sentence(meta), level=level))
