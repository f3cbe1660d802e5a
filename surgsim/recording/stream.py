"""Recordings made in memory and written by surgsim.

rerun writes files from threads of its own. If the disk is full they stop, and a flush waits for them without
end. So a recording is made in memory, where nothing can fail, and written as any other file.

rerun keeps the threads of a recording for ever if a blueprint was given to it, and the chunks with them: the
blueprint's memory and its stream hold each other. Here the blueprint's stream is disconnected, and both are
dropped, so that a thousand recordings take no more memory and threads than one.
"""

from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb
import rerun_bindings as bindings

from surgsim.errors import RecordingError
from surgsim.recording.files import replacing, write_file
from surgsim.recording.framing import check_framing
from surgsim.recording.layout import APPLICATION

FLUSH_TIMEOUT_S = 60.0
"""How long rerun may take to encode a recording in memory."""


@contextmanager
def stream_to(
    path: Path, blueprint: rrb.Blueprint, *, recording_id: str | None = None
) -> Iterator[rr.RecordingStream]:
    """A stream to log to; `path` is written when the block ends well, whole or not at all.

    Args:
        path: File to write, `.rrd`; replaced if it exists.
        blueprint: The viewer's layout.
        recording_id: What tells the recording apart in a viewer; random if None.

    Raises:
        SurgsimError: If rerun does not finish the recording, or the file cannot be written.
    """
    try:
        content = yield from _encoded(blueprint, recording_id)
    except RuntimeError as error:
        raise RecordingError(f"{path}: cannot be recorded: {error}") from error
    finally:
        bindings.flush_and_cleanup_orphaned_recordings()
    with replacing(path) as temporary:
        write_file(temporary, content)
        check_framing(temporary)


def _encoded(
    blueprint: rrb.Blueprint, recording_id: str | None
) -> Generator[rr.RecordingStream, None, bytes]:
    """Yield the stream, and return the recording's bytes."""
    stream = rr.RecordingStream(APPLICATION, recording_id=recording_id, send_properties=False)
    encoder = stream.binary_stream()
    _send_blueprint(stream, blueprint)
    yield stream
    content = encoder.read(flush_timeout_sec=FLUSH_TIMEOUT_S)
    stream.disconnect()
    return content or b""


def _send_blueprint(stream: rr.RecordingStream, blueprint: rrb.Blueprint) -> None:
    """Make `blueprint` the layout of `stream`, as `stream.send_blueprint` does, and let go of it."""
    layout = rr.RecordingStream._from_native(
        bindings.new_blueprint(
            application_id=APPLICATION, make_default=False, make_thread_default=False, default_enabled=True
        )
    )
    layout.set_time("blueprint", sequence=0)
    blueprint._log_to_stream(layout)
    # Active, not only the default: a browser shows the recording before it has the layout, in one of its own.
    active, default = True, True
    bindings.send_blueprint(layout.memory_recording().storage, active, default, recording=stream.to_native())
    layout.disconnect()
