"""Do the same thing with many values in several processes, each told of and ended in order."""

import multiprocessing
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Any, TypeVar

from surgsim.compiling import listening, tell
from surgsim.runs.stop import obey_parent

A = TypeVar("A")
B = TypeVar("B")
_told: Any = None
"""In a worker: the queue to its parent, for what it compiles."""


def in_processes(function: Callable[[A], B], values: Sequence[A], count: int) -> Iterator[B]:
    """`function` of every value, in order, each as soon as it is there.

    Args:
        function: A function of a module, or a partial one.
        values: What to call it with.
        count: Number of processes; below two it is called here.
    """
    if count < 2:
        yield from map(function, values)
        return
    spawn, others = multiprocessing.get_context("spawn"), set(multiprocessing.active_children())
    told = spawn.Queue()
    listener = threading.Thread(target=_tell_all, args=(told,), daemon=True)
    listener.start()
    pool = ProcessPoolExecutor(count, mp_context=spawn, initializer=_begin, initargs=(told,))
    try:
        yield from pool.map(_Called(function), values)
    except BaseException:
        for worker in set(multiprocessing.active_children()) - others:
            worker.kill()  # a case may take minutes: nobody waits for it
        raise
    finally:
        pool.shutdown(cancel_futures=True)
        told.put(None)
        listener.join()


class _Called:
    """A function that tells the parent of kernels that are compiled meanwhile."""

    def __init__(self, function: Callable[[Any], Any]) -> None:
        self._function = function

    def __call__(self, value: Any) -> Any:
        with listening(_told.put):
            return self._function(value)


def _tell_all(told: Any) -> None:
    for compiling in iter(told.get, None):
        tell(compiling)


def _begin(told: Any) -> None:
    """The beginning of a worker: signals are its parent's to handle, and it does not outlive it."""
    global _told
    _told = told
    obey_parent()
