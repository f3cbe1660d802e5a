"""Signals that end a command in order: every draft is removed on the way out."""

import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

_SIGNALS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)  # Ctrl-C; the time limit of a cluster, `timeout`, a container's end; a closed terminal
_GRACE_S = 5.0
_AGAIN_S = 0.01


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

    def as_if_it_had_not_come() -> None:
        nonlocal last
        last = -_GRACE_S

    dropped = sys.unraisablehook
    sys.unraisablehook = _sending_again(dropped, as_if_it_had_not_come)
    before = {number: signal.getsignal(number) for number in _SIGNALS}
    taken = [number for number, handler in before.items() if handler not in (signal.SIG_IGN, None)]
    for number in taken:
        signal.signal(number, stop)
    try:
        yield
    finally:
        for number in taken:
            signal.signal(number, before[number])
        sys.unraisablehook = dropped


def _sending_again(
    otherwise: Callable[[Any], object], before: Callable[[], object]
) -> Callable[["sys.UnraisableHookArgs"], None]:
    """A hook that sends a signal again whose exception Python dropped, after a call of `before`.

    Python drops and prints what is raised while it finalises an object, and a signal may come just then. The
    hook does not raise, it would be dropped too: the signal comes again a moment later.

    Args:
        otherwise: What is to be done with any other exception that was dropped.
        before: Makes the handler ready for the signal.
    """

    def hook(dropped: "sys.UnraisableHookArgs") -> None:
        error = dropped.exc_value
        if not isinstance(error, Stopped | _Leaving):
            otherwise(dropped)
            return
        before()
        again = threading.Timer(_AGAIN_S, os.kill, (os.getpid(), error.exit_status - 128))
        again.daemon = True
        again.start()

    return hook


def obey_parent() -> None:
    """In a worker process: Ctrl-C is the parent's to handle; its SIGTERM ends the run under way in order.

    The worker ends at once when its parent does, so that a resumed batch never meets an old one.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _leave_at_a_signal()
    sys.unraisablehook = _sending_again(sys.unraisablehook, _leave_at_a_signal)
    threading.Thread(target=_die_with_parent, daemon=True).start()


def _die_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def leave_in_peace() -> None:
    """In a worker process that is about to end: SIGTERM no longer disturbs its way out."""
    signal.signal(signal.SIGTERM, _pass_over)


def _pass_over(number: int, _: FrameType | None) -> None:
    """Do nothing. Python complains of one that is ignored by SIG_IGN if it came a moment before."""


class _Leaving(SystemExit):
    """A signal asked the worker to end.

    Attributes:
        exit_status: What it ends with.
    """

    def __init__(self, number: int) -> None:
        self.exit_status = 128 + number
        super().__init__(self.exit_status)


def _leave_at_a_signal() -> None:
    signal.signal(signal.SIGTERM, _leave)


def _leave(number: int, _: FrameType | None) -> None:
    signal.signal(number, _pass_over)
    raise _Leaving(number)


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
