"""A run in the viewer while it goes on: the entities of its recording, sent piece by piece."""

import socket
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
import rerun as rr

from surgsim.array import Array
from surgsim.errors import SurgsimError
from surgsim.recording.below import by_arm
from surgsim.recording.blueprint import blueprint
from surgsim.recording.layout import APPLICATION
from surgsim.recording.scene import log_paths, log_points, log_poses, log_shapes, rebuild_all, sampled_rows
from surgsim.recording.signals import log_signals
from surgsim.recording.view import display
from surgsim.recording.write import log_texts, recording_name
from surgsim.scenario.arms import Experiment
from surgsim.trace.trace import Trace

_LAID_OUT_AFTER_S = 0.5
_CONNECT_S = 5.0


@dataclass
class _Paths:
    """Desired and actual way of a tip so far, piece by piece, each (rows, 3) [m]."""

    desired: list[Array] = field(default_factory=list)
    actual: list[Array] = field(default_factory=list)


class LiveView:
    """Sends what is new of a run to a viewer.

    Signals, poses, points, paths and texts are those of `recording.rrd`, on the same entities and with the
    same layout. What a recording stores beside them for reading it back is left out.

    Args:
        stream: Connected to the viewer.
        scenario: What is run.
        duration_s: How long that takes at most [s].
    """

    def __init__(self, stream: rr.RecordingStream, scenario: Experiment, duration_s: float) -> None:
        self._stream, self._scenario, self._duration_s = stream, scenario, duration_s
        self._scenes = rebuild_all(scenario)
        self._paths = [_Paths() for _ in self._scenes]
        self._laid_out = False
        stream.send_recording_name(recording_name(scenario))
        self._bodies = log_shapes(stream, self._scenes[0])

    def show(self, piece: Trace) -> None:
        """Show further rows of the run."""
        if len(piece) == 0:
            return
        if not self._laid_out and piece["t_s"][-1] >= _LAID_OUT_AFTER_S:
            self._stream.send_blueprint(blueprint(self._scenario, piece, self._duration_s))
            self._laid_out = True
        rate = self._scenario.recording.scene_rate_hz * piece.meta.control_period_s
        rows = sampled_rows(len(piece), rate)
        log_poses(self._stream, self._scenes, self._bodies, piece, rows, goes_on=True)
        arms = zip(self._scenes, self._paths, by_arm(self._stream, piece), strict=True)
        for scene, paths, (stream, one) in arms:
            log_signals(stream, one)
            log_points(self._stream, one, rows, scene)
            paths.desired.append(one.block("tip_ref")[rows])
            paths.actual.append(one.block("tip")[rows])
            desired, actual = np.concatenate(paths.desired), np.concatenate(paths.actual)
            log_paths(self._stream, desired, actual, scene.prefix)

    def end(self, trace: Trace, metrics: Mapping[str, float | None]) -> None:
        """Show how the run ended, in the layout of its recording."""
        log_texts(self._stream, trace.meta, metrics)
        self._stream.send_blueprint(blueprint(self._scenario, trace))
        self._stream.flush()


@contextmanager
def viewer(address: str | None) -> Iterator[rr.RecordingStream]:
    """A stream to a viewer: a new window, or one that waits at an address `host:port`.

    Raises:
        SurgsimError: If there is no display for a window, or nobody answers at the address.
    """
    stream = rr.RecordingStream(APPLICATION, send_properties=False)
    try:
        if address is None:
            if not display():
                raise SurgsimError(
                    "--live opens a window, and this session has no display; start a viewer elsewhere "
                    "(`rerun`), and give its address: --live HOST:9876"
                )
            stream.spawn()
        else:
            _check_somebody(address)
            stream.connect_grpc(f"rerun+http://{address}/proxy")
        yield stream
    finally:
        stream.disconnect()


def _check_somebody(address: str) -> None:
    """See that a viewer answers: rerun itself waits for one without end."""
    host, colon, port = address.rpartition(":")
    if not colon or not port.isdigit():
        raise SurgsimError(f"--live: '{address}' is no address; give HOST:PORT, rerun's own port is 9876")
    try:
        socket.create_connection((host, int(port)), timeout=_CONNECT_S).close()
    except (OSError, OverflowError) as error:
        raise SurgsimError(f"--live: no viewer answers at {address}: {error}") from error
