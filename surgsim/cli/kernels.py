"""What a person sees while kernels are compiled: how many, once, and how long it took; all on stderr."""

import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from surgsim.compiling import Compiling, listening
from surgsim.display import count

if TYPE_CHECKING:
    from surgsim.scenario.arms import Experiment
    from surgsim.scenario.schema import Scenario

_PATIENCE_S = 3.0
_EVERY_S = 180.0
_MANY = 100
_screens: list[Callable[[str], None]] = []
_helpers: list[Callable[[], None]] = []


@contextmanager
def compiling_shown() -> Iterator[None]:
    """Show kernels that are compiled meanwhile, and on a terminal at the end how many there were."""
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


@contextmanager
def compiled_by_two() -> Iterator[Callable[["Experiment"], None]]:
    """If kernels have to be compiled meanwhile, have a second process compile those that every run needs.

    It starts at once where no kernel is kept, else with the first that is compiled. It compiles from when the
    scenario is known: what is yielded takes it.
    """
    with ExitStack() as stack:
        second = _Second(stack)
        if not any(True for _ in _kept()) and _is_kept():
            second.start()
        _helpers.append(second.start)
        try:
            yield second.runs
        finally:
            _helpers.remove(second.start)


class _Second:
    """A second process, which is told once for how many joints it compiles."""

    def __init__(self, stack: ExitStack) -> None:
        self._stack = stack
        self._compile_for: Callable[[int], None] | None = None
        self._scenario: Scenario | None = None
        self._helps = True

    def start(self) -> None:
        """Start the process, if there is none yet and it helps."""
        from surgsim.simulate.ahead import compiling_ahead

        if self._compile_for is None and self._helps:
            self._compile_for = self._stack.enter_context(compiling_ahead())
            self._tell()

    def runs(self, scenario: "Experiment") -> None:
        """Say what is going to run; several arms have other kernels."""
        from surgsim.scenario.schema import Scenario

        if isinstance(scenario, Scenario):
            self._scenario = scenario
            self._tell()
        else:
            self._helps = False
            self._stack.close()

    def _tell(self) -> None:
        from surgsim.models.arm import ArmModel

        if self._compile_for is not None and self._scenario is not None:
            self._compile_for(ArmModel(self._scenario.scene).limits.q_min.size)


class _Shown:
    """Counts kernels: a line that is written over on a terminal, else one, and more only if it takes long.

    Where no folder can keep kernels the cache says so itself, in a line that is enough for a log.
    """

    def __init__(self) -> None:
        self._done = self._most = self._under_way = 0
        self._began_s = self._took_s = 0.0
        self._next_s: float | None = None
        self._began_at = time.time()
        self._kept = True
        self._said = False
        self._terminal = sys.stderr.isatty()

    def __call__(self, told: Compiling) -> None:
        now = time.perf_counter()
        if self._next_s is None:
            self._next_s = now + _PATIENCE_S
            self._kept = _is_kept()
            if self._kept and _helpers:
                _helpers[-1]()
        if not told.awaited:
            self._count(told, now)
        elif self._under_way:  # of a worker that another one keeps waiting
            return
        if self._terminal:
            self._show(told)
        elif now >= self._next_s and self._kept:
            print(self._line(told), file=sys.stderr, flush=True)
            self._said, self._next_s = True, now + _EVERY_S

    def _show(self, told: Compiling) -> None:
        """Write over the line of before, and not before the cache has said that nothing is kept.

        Where no kernel is under way the line is empty, for what a command may print then.
        """
        if self._kept or self._done:
            self._said = True
            text = self._text(told)
            if _screens:
                _screens[-1](text)
            else:
                _overwrite(text if self._under_way or told.awaited else "")

    def _text(self, told: Compiling) -> str:
        if told.awaited:
            return "waiting for kernels that another process compiles"
        once = " (once)" if self._kept else ""
        return f"compiling kernels{once}: {self._done} of at most {self._most}"

    def _line(self, told: Compiling) -> str:
        if told.awaited or self._said:
            return self._text(told)
        how_long = "a minute or two" if self._most > _MANY else "less than a minute"
        return f"compiling kernels (once): at most {self._most}, {how_long}"

    def _count(self, told: Compiling, now: float) -> None:
        """Add to the kernels, and to the time in which one of them at least was under way."""
        if self._under_way:
            self._took_s += now - self._began_s
        self._began_s = now
        self._under_way = max(0, self._under_way + (-1 if told.ended else 1))
        self._done += told.ended
        self._most = max(self._most, told.most, self._done)

    def end(self) -> None:
        """On a terminal, put what was done in the place of the line, if there was one."""
        if self._said and self._terminal:
            text = f"compiled {count(self._done, 'kernel')} in {self._took_s:.0f} s{_where(self._began_at)}\n"
            print("\r\x1b[K" + (text if self._done else ""), end="", file=sys.stderr, flush=True)


def _overwrite(text: str) -> None:
    print(f"\r\x1b[K{text}", end="", file=sys.stderr, flush=True)


def _kept() -> Iterator[tuple[Path, float]]:
    """Folder of each kernel that is kept, and when it was used [s of the epoch]."""
    from surgsim.compiled.cache import SUFFIX
    from surgsim.compiled.places import places

    for place in places():
        with suppress(OSError):  # a folder that this user may not look into, a kernel that goes meanwhile
            for entry in place.glob(f"*{SUFFIX}"):
                yield place, entry.stat().st_mtime


def _is_kept() -> bool:
    """Whether there is a folder for kernels."""
    from surgsim.compiled.cache import place_to_write

    return place_to_write() is not None


def _where(began_at: float) -> str:
    """Where what was compiled since `began_at`, seconds of the epoch, is kept; empty if nowhere."""
    for place, used_at in _kept():
        if used_at >= began_at:
            temporary = Path(tempfile.gettempdir()) in place.parents
            return "; kept among the temporary files" if temporary else "; kept for the next start"
    return ""
