"""What compiles, and how long it takes: clocks that leave it out, and word of it to who listens."""

import threading
import time
from time import perf_counter
from typing import Any

from numba.core import event

from surgsim.compiled.lock import release_all
from surgsim.compiling import Compiling, tell


class _Counts:
    """Kernels of this process."""

    declared = 0
    compiled = 0
    loaded = 0


class _OwnTime(threading.local):
    """What a thread spent on getting its kernels."""

    depth = 0
    began_s = 0.0
    spent_s = 0.0
    thread_began_ns = 0
    thread_spent_ns = 0


_counts, _own = _Counts(), _OwnTime()


def declare() -> None:
    """Count a kernel that may have to be compiled."""
    _counts.declared += 1


def loaded() -> None:
    """Count a kernel that needs not be compiled."""
    _counts.loaded += 1


def began(kernel: str) -> None:
    """Tell that a kernel is being compiled."""
    tell(Compiling(kernel=kernel, most=_most(), ended=False))


def awaits(kernel: str) -> None:
    """Tell that another process compiles a kernel that is needed here."""
    tell(Compiling(kernel=kernel, most=_most(), ended=False, awaited=True))


def ended(kernel: str) -> None:
    """Tell that a kernel was compiled."""
    _counts.compiled += 1
    tell(Compiling(kernel=kernel, most=_most(), ended=True))


def _most() -> int:
    return max(_counts.declared - _counts.loaded, _counts.compiled)


def working_time() -> float:
    """A clock [s] that stands still while this thread waits for a kernel to be compiled or loaded."""
    return perf_counter() - _own.spent_s


def thread_time_ns() -> int:
    """Processor time of this thread [ns], without what it spent on compiling or loading kernels."""
    return time.thread_time_ns() - _own.thread_spent_ns


class _Timer(event.Listener):
    """Adds up the time in which a thread holds or awaits numba's compiler."""

    def on_start(self, event: Any) -> None:
        if _own.depth == 0:
            _own.began_s, _own.thread_began_ns = perf_counter(), time.thread_time_ns()
        _own.depth += 1

    def on_end(self, event: Any) -> None:
        _own.depth = max(0, _own.depth - 1)
        if _own.depth == 0:
            release_all()
            _own.spent_s += perf_counter() - _own.began_s
            _own.thread_spent_ns += time.thread_time_ns() - _own.thread_began_ns


event.register("numba:compiler_lock", _Timer())
