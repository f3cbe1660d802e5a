"""What a person sees while kernels are compiled: how many, once, and how long it took; all on stderr."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from surgsim.compiling import Compiling, listening

_PATIENCE_S = 3.0
_EVERY_S = 5.0
_screens: list[Callable[[str], None]] = []


@contextmanager
def compiling_shown() -> Iterator[None]:
    """Show kernels that are compiled meanwhile, and at the end how many there were; else nothing."""
    shown = _Shown()
    try:
        with listening(shown):
            yield
    finally:
        shown.end()


@contextmanager
def on_screen(show: Callable[[str], None]) -> Iterator[None]:
    """Have `show` put the text where it fits, in the place of a line of its own: a bar is on the screen."""
    _screens.append(show)
    try:
        yield
    finally:
        _screens.remove(show)


class _Shown:
    """Counts kernels: a line that is written over on a terminal, else one every few seconds."""

    def __init__(self) -> None:
        self._done = self._most = self._under_way = 0
        self._began_s = self._took_s = 0.0
        self._last_s: float | None = None
        self._said = False
        self._terminal = sys.stderr.isatty()

    def __call__(self, told: Compiling) -> None:
        now = time.perf_counter()
        if self._last_s is None:
            self._last_s = now + _PATIENCE_S - _EVERY_S
        if not told.awaited:
            self._count(told, now)
            text = f"compiling kernels (once): {self._done} of at most {self._most}"
        elif self._under_way:  # of a worker that another one keeps waiting
            return
        else:
            text = "waiting for kernels that another process compiles"
        if self._terminal:
            self._said = True
            (_screens[-1] if _screens else _overwrite)(text)
        elif now - self._last_s >= _EVERY_S:
            self._said, self._last_s = True, now
            print(text, file=sys.stderr, flush=True)

    def _count(self, told: Compiling, now: float) -> None:
        """Add to the kernels, and to the time in which one of them at least was under way."""
        if self._under_way:
            self._took_s += now - self._began_s
        self._began_s = now
        self._under_way = max(0, self._under_way + (-1 if told.ended else 1))
        self._done += told.ended
        self._most = max(self._most, told.most, self._done)

    def end(self) -> None:
        """Say what was done, if anything was said before."""
        clear = "\r\x1b[K" if self._said and self._terminal else ""
        if self._said and not self._done:
            print(clear, end="", file=sys.stderr, flush=True)
        elif self._said:
            kernels = "kernel" if self._done == 1 else "kernels"
            text = f"compiled {self._done} {kernels} in {self._took_s:.0f} s; the next start finds them"
            print(clear + text, file=sys.stderr, flush=True)


def _overwrite(text: str) -> None:
    print(f"\r\x1b[K{text}", end="", file=sys.stderr, flush=True)
