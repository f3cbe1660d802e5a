"""One process compiles a kernel, the others wait for it: two workers do not do the same twice."""

import fcntl
import os
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

_PATIENCE_S = 300.0
_PAUSE_S = 0.02


class _Held(threading.local):
    """Locks of a thread's kernels that are being compiled: one, and one for each caller of it."""

    def __init__(self) -> None:
        self.locks: list[CompileLock] = []


_held = _Held()


def release_all() -> None:
    """Release what this thread holds: it compiles nothing any more, or failed."""
    while _held.locks:
        _held.locks[-1].release()


class CompileLock:
    """A lock on a file beside a kernel's entry; it ends with the process that holds it."""

    def __init__(self, entry: Path) -> None:
        self._path = entry.with_suffix(".lock")
        self._handle: int | None = None

    def acquire(self, there: Callable[[], bool], waits: Callable[[], None]) -> None:
        """Wait until no other process compiles this kernel, or until the entry is `there`.

        `waits` is called once, if another process is at it. Where a file system knows no locks, or somebody
        holds one for too long, it goes on without.
        """
        until, said = time.monotonic() + _PATIENCE_S, False
        with suppress(OSError):
            self._handle = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
            while not there() and time.monotonic() < until:
                try:
                    fcntl.flock(self._handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except BlockingIOError:
                    if not said:
                        waits()
                        said = True
                    time.sleep(_PAUSE_S)
                else:
                    _held.locks.append(self)
                    return
        self._close()

    def release(self) -> None:
        """Let the next process have it; the file goes away."""
        if self in _held.locks:
            _held.locks.remove(self)
            with suppress(OSError):
                self._path.unlink()
        self._close()

    def _close(self) -> None:
        if self._handle is not None:
            os.close(self._handle)
            self._handle = None
