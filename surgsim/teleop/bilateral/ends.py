"""How the two sides call a bilateral scheme: by the addresses of its kernels."""

from typing import Any, ClassVar

from surgsim.array import Array
from surgsim.compiled import address_of, call_at, compiled
from surgsim.teleop.bilateral.base import BilateralScheme, End, compiled_only, end_signature
from surgsim.teleop.messages import MODES, SCHEME
from surgsim.teleop.receiver import Receiver, ReceiverLaw, trust
from surgsim.tick.arrays import Record
from surgsim.tick.overlay import take


class CalledScheme(Record):
    """Where a scheme's kernels, numbers and memory are.

    Attributes:
        feel: Address of the kernel; as the next two, see `BilateralScheme`.
        tell: Address.
        follow: Address.
        gains: Where in the gains its numbers begin.
        gain_count: How many.
        memory: Where in the memory that of this end begins.
        memory_size: Its length.
    """

    ADDRESSES: ClassVar[frozenset[str]] = frozenset(("feel", "tell", "follow"))
    feel: int
    tell: int
    follow: int
    gains: int
    gain_count: int
    memory: int
    memory_size: int


@compiled
def see(
    law: ReceiverLaw, receiver: Receiver, end: End, t_s: float, period_s: float, received_j: float
) -> None:
    """Fill in what has come: message, trust and energy."""
    end.t_s, end.period_s, end.received_j = t_s, period_s, received_j
    end.known = 1 if receiver.highest >= 0 else 0
    end.trust = trust(law, receiver, t_s)
    end.received[:] = receiver.content


@compiled
def ask(kernel: int, called: CalledScheme, gains: Array, end: End, memory: Array) -> int:
    """Call the scheme's kernel at that address, with its numbers and the memory of this end; a status."""
    numbers = gains[called.gains : called.gains + called.gain_count]
    status: int = call_at(kernel, numbers, end, memory[called.memory : called.memory + called.memory_size])
    return status


def describe_law(side: Any, bilateral: Any, scheme: BilateralScheme | None) -> None:
    """Fill the law of a side: its own, or where the kernels of a scheme are."""
    if scheme is None:
        take(side, bilateral)
        side.passivity = MODES[bilateral.passivity]
        take(side.tank, bilateral.tanks)
        take(side.control, bilateral.passivity_control)
        side.control.coordinates = bilateral.passivity_control.port_force == "coordinating"
        return
    side.passivity = SCHEME
    for name in ("feel", "tell", "follow"):
        side.scheme[name] = address_of(compiled_only(getattr(scheme, name), name), end_signature())
