"""A disk that refuses: the n-th call that reaches it fails, as a full or a broken disk makes it fail."""

import errno
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from surgsim.runs import exchange

FULL, BROKEN = errno.ENOSPC, errno.EIO
CALLS = {
    "open": FULL,
    "write": FULL,
    "fsync": BROKEN,
    "close": BROKEN,
    "mkdir": FULL,
    "chmod": BROKEN,
    "rename": FULL,
    "replace": FULL,
    "unlink": BROKEN,
    "rmdir": BROKEN,
}
"""Functions of `os` that change a disk or wait for it, and how they fail."""
NEEDING_SPACE = {"create", "write", "fsync", "mkdir", "rename", "replace", "swap"}
"""What goes on to fail on a full disk; removing does not."""


@dataclass
class Disk:
    """Counts the calls below `root` and makes some fail.

    Attributes:
        root: Folder that is watched.
        fail_at: Which call fails, counted from 1; 0 for none.
        stays_full: Whether all later calls that need space fail too.
        calls: Names of the calls so far.
    """

    root: Path
    fail_at: int = 0
    stays_full: bool = False
    calls: list[str] = field(default_factory=list)
    handles: set[int] = field(default_factory=set)

    def wrap(self, name: str, call: Callable[..., Any], number: int) -> Callable[..., Any]:
        def watched(*arguments: Any, **options: Any) -> Any:
            if self._is_below(arguments[0], options.get("dir_fd")):
                making = name == "open" and arguments[1] & os.O_CREAT
                self._count("create" if making else name, number, arguments[0])
                given = call(*arguments, **options)
                if name == "open":
                    self.handles.add(given)
                return given
            return call(*arguments, **options)

        return watched

    def wrap_close(self, call: Callable[[int], None]) -> Callable[[int], None]:
        """Closing frees the handle even if it fails."""

        def close(handle: int) -> None:
            ours = handle in self.handles
            self.handles.discard(handle)
            call(handle)
            if ours:
                self._count("close", CALLS["close"], handle)

        return close

    def _is_below(self, place: Any, folder: int | None) -> bool:
        if folder is not None:
            return folder in self.handles
        if isinstance(place, int):
            return place in self.handles
        return Path(os.path.abspath(os.fsdecode(place))).is_relative_to(self.root)

    def _count(self, name: str, number: int, place: Any) -> None:
        self.calls.append(name)
        now = len(self.calls)
        later = self.stays_full and 0 < self.fail_at < now and name in NEEDING_SPACE
        if now == self.fail_at or later:
            number = FULL if later else number
            raise OSError(number, os.strerror(number), str(place))

    def heal(self) -> None:
        """Let every later call through, and count none."""
        self.root = Path("/nowhere")

    @property
    def was_reached(self) -> bool:
        """Whether the call that was to fail came."""
        return len(self.calls) >= self.fail_at


@pytest.fixture
def faulty_disk(monkeypatch) -> Callable[..., Disk]:
    """Factory of a `Disk`; it is watched until the next one is made or the test ends."""

    def make(root: Path, fail_at: int = 0, stays_full: bool = False) -> Disk:
        monkeypatch.undo()
        disk = Disk(root.resolve(), fail_at, stays_full)
        monkeypatch.setattr(os, "fsync", lambda handle: None)  # counted, and not waited for
        for name, number in CALLS.items():
            if name != "close":
                monkeypatch.setattr(os, name, disk.wrap(name, getattr(os, name), number))
        monkeypatch.setattr(os, "close", disk.wrap_close(os.close))
        monkeypatch.setattr(exchange, "swap", disk.wrap("swap", exchange.swap, BROKEN))
        return disk

    return make
