"""Signals that end a command in order: every draft is removed on the way out."""

import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_SIGNALS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)  # Ctrl-C; the time limit of a cluster, `timeout`, a container's end; a closed terminal
_GRACE_S = 5.0


class Stopped(KeyboardInterrupt):
    """A signal asked the command to end.

    Attributes:
        exit_status: What a shell expects of a command that this signal ended.
    """

    def __init__(self, number: int) -> None:
        self.exit_status = 128 + number
        super().__init__(signal.Signals(number).name)

    @property
    def told(self) -> str:
        """What happened, in a word or two."""
        return "interrupted" if self.exit_status == 128 + signal.SIGINT else f"ended by {self}"


@contextmanager
def stopping_in_order() -> Iterator[None]:
    """Turn the signals into `Stopped`, raised in the main thread; one that is ignored (nohup) stays so.

    Programs like `timeout` send a signal twice, and people press Ctrl-C twice. What comes within five
    seconds of the first is passed over, so that it does not disturb the tidying.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    last = -_GRACE_S

    def stop(number: int, _: FrameType | None) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last < _GRACE_S:
            return
        last = now
        raise Stopped(number)

    before = {number: signal.getsignal(number) for number in _SIGNALS}
    taken = [number for number, handler in before.items() if handler not in (signal.SIG_IGN, None)]
    for number in taken:
        signal.signal(number, stop)
    try:
        yield
    finally:
        for number in taken:
            signal.signal(number, before[number])


def obey_parent() -> None:
    """In a worker process: Ctrl-C is the parent's to handle; its SIGTERM ends the run under way in order.

    The worker ends at once when its parent does, so that a resumed batch never meets an old one.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _leave)
    threading.Thread(target=_die_with_parent, daemon=True).start()


def _die_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def leave_in_peace() -> None:
    """In a worker process that is about to end: SIGTERM no longer disturbs its way out."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)


def _leave(number: int, _: FrameType | None) -> None:
    signal.signal(number, signal.SIG_IGN)
    sys.exit(128 + number)


@contextmanager
def held_back() -> Iterator[None]:
    """Hold the signals back: they arrive after the block, and never in a process that is started in it."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
