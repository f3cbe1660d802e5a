"""What a kernel may have inside it: a Python object that it enters, and a resolver below it.

A law that is Python by nature in one place (a policy, a library's solver) is a kernel all the same: what can
be compiled is, and it enters Python for the rest, when it needs it. The gains of such a kernel begin with a
`Head`. Whoever joins the part to the records of a tick fills that in (`surgsim.control.joining`).
"""

from collections.abc import Callable
from typing import ClassVar, Protocol

from surgsim.array import Array
from surgsim.compiled import call_at, compiled
from surgsim.tick.arrays import Numbers, Record, Resolved, Seen
from surgsim.tick.fields import Fields
from surgsim.tick.overlay import overlay
from surgsim.tick.views import numbers


class Head(Record):
    """Beginning of the gains of a kernel that has something inside it.

    Attributes:
        entry: Address of the C function that enters Python; `surgsim.tick.python_part.enter` calls it.
        below: Address of the kernel of the resolver below.
        below_gains: Its numbers.
    """

    ADDRESSES: ClassVar[frozenset[str]] = frozenset(("entry", "below"))
    entry: int
    below: int
    below_gains: Numbers


HEAD, HEAD_SIZE = overlay(Head)


class Inside(Protocol):
    """A Python object that a kernel enters in its midst. Whatever it remembers by itself is in snapshots."""

    def join(self, seen: Fields, memory: Array) -> Callable[[], int | None]:
        """What the kernel enters; it returns a status, or None for `GOES_ON`.

        Args:
            seen: What the kernel sees, at every tick in the same place.
            memory: The kernel's memory: where it asks, and is answered.
        """
        ...


class Elsewhere(Protocol):
    """A controller outside surgsim that a kernel asks, by addresses in its gains."""

    @property
    def has_state(self) -> bool:
        """Whether it remembers something that is not in the kernel's memory."""
        ...

    def close(self) -> None:
        """End it: it is not asked again."""
        ...


@compiled
def resolve_below(gains: Array, seen: Seen, memory: Array, out: Resolved) -> int:
    """Ask the resolver below, which has `memory` for its own."""
    head = gains[:HEAD_SIZE].view(HEAD)[0]
    status: int = call_at(head.below, numbers(head.below_gains), seen, memory, out)
    return status
