"""Who is told of kernels that are being compiled.

It imports nothing, so that a command can listen before anything heavy is imported.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Compiling:
    """A kernel that is being compiled, or was.

    Attributes:
        kernel: Its name.
        most: How many kernels its process may have to compile, as far as it knows now.
        ended: Whether it is done.
        awaited: Whether another process is at it, and this one waits; nothing is told when the wait ends.
    """

    kernel: str
    most: int
    ended: bool
    awaited: bool = False


Listener = Callable[[Compiling], None]
_listeners: list[Listener] = []


def tell(compiling: Compiling) -> None:
    """Tell who listens, of a kernel of this process or of another one."""
    if _listeners:
        _listeners[-1](compiling)


@contextmanager
def listening(listener: Listener) -> Iterator[None]:
    """Have `listener`, and nobody else, told of every kernel that is compiled meanwhile."""
    _listeners.append(listener)
    try:
        yield
    finally:
        _listeners.remove(listener)
