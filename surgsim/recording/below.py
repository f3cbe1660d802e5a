"""A stream whose entities lie below one: of one of two runs, or of one of several arms."""

from typing import Any

import rerun as rr

from surgsim.trace.trace import Trace


class Below:
    """A stream that puts every entity below `side`."""

    def __init__(self, stream: "rr.RecordingStream | Below", side: str) -> None:
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


def by_arm(
    stream: "rr.RecordingStream | Below", trace: Trace
) -> "list[tuple[rr.RecordingStream | Below, Trace]]":
    """The trace of each arm with where its signals go: of several, below the arm's name."""
    if not trace.arms:
        return [(stream, trace)]
    return [(Below(stream, arm), trace.of(arm)) for arm in trace.arms]
