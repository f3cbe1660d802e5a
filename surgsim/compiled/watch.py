"""What compiles, and how long it took: for progress, and for clocks that leave it out."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from time import perf_counter
from typing import Any

from numba.core import event

from surgsim.compiled.lock import release_all


@dataclass(frozen=True, kw_only=True)
class Compiling:
    """A kernel that is being compiled, or was.

    Attributes:
        kernel: Its name.
        done: Kernels that were compiled since the process began.
        most: Kernels that may have to be, as far as is known now.
        ended: Whether it is done.
    """

    kernel: str
    done: int
    most: int
    ended: bool


Listener = Callable[[Compiling], None]


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


_counts, _own = _Counts(), _OwnTime()
_listeners: list[Listener] = []


def declare(dispatcher: Any) -> None:
    """Count a kernel that may have to be compiled."""
    _counts.declared += 1


def loaded() -> None:
    """Count a kernel that needs not be compiled."""
    _counts.loaded += 1


def began(kernel: str) -> None:
    """Tell that a kernel is being compiled."""
    tell(Compiling(kernel=kernel, done=_counts.compiled, most=_most(), ended=False))


def ended(kernel: str) -> None:
    """Tell that a kernel was compiled."""
    _counts.compiled += 1
    tell(Compiling(kernel=kernel, done=_counts.compiled, most=_most(), ended=True))


def _most() -> int:
    return max(_counts.declared - _counts.loaded, _counts.compiled + 1)


def tell(compiling: Compiling) -> None:
    """Tell all who listen, of a kernel of this process or of another one."""
    for listener in list(_listeners):
        listener(compiling)


@contextmanager
def listening(listener: Listener) -> Iterator[None]:
    """Have `listener` told of every kernel that is compiled meanwhile."""
    _listeners.append(listener)
    try:
        yield
    finally:
        with suppress(ValueError):
            _listeners.remove(listener)


def working_time() -> float:
    """A clock [s] that stands still while this thread waits for a kernel to be compiled or loaded."""
    return perf_counter() - _own.spent_s


class _Timer(event.Listener):
    """Adds up the time in which a thread holds or awaits numba's compiler."""

    def on_start(self, event: Any) -> None:
        if _own.depth == 0:
            _own.began_s = perf_counter()
        _own.depth += 1

    def on_end(self, event: Any) -> None:
        _own.depth = max(0, _own.depth - 1)
        if _own.depth == 0:
            release_all()
            _own.spent_s += perf_counter() - _own.began_s


event.register("numba:compiler_lock", _Timer())
