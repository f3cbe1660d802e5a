"""Joins a part to the records of a tick: kernels by their addresses, Python parts through a trampoline."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numba.core.dispatcher import Dispatcher

from surgsim.array import Array
from surgsim.compiled import address_of
from surgsim.control.failure import ControlFailure
from surgsim.control.inside import Head
from surgsim.control.problem import Resolution
from surgsim.control.seen import velocity_problem_of
from surgsim.errors import Outcome
from surgsim.models.build import JointLimits
from surgsim.tick.arrays import Seen, point, resolver_signature
from surgsim.tick.fields import fields_of
from surgsim.tick.overlay import laid_over
from surgsim.tick.python_part import PythonPart, python_kernel
from surgsim.tick.status import INFEASIBLE, RANK_LOST, TOLD

Call = Callable[[], int | None]


@dataclass(frozen=True, kw_only=True)
class Desk:
    """What a part works on.

    Attributes:
        seen: What it sees.
        out: Where its answer goes.
        memory: Its memory, where it is a kernel.
        limits: The arm's limits.
        remembered: What parts that are Python objects remember, by their names.
    """

    seen: Seen
    out: Any
    memory: Array
    limits: JointLimits
    remembered: dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Joined:
    """A part as a kernel calls it; to be kept for as long as it is called.

    Attributes:
        kernel: Address of its kernel, or of the trampoline.
        gains: What that is given.
        entered: What of the part is entered in Python, in the order of a tick.
        below: The resolver below it.
        asks_outside: Whether it asks a controller outside surgsim.
    """

    kernel: int
    gains: Array
    entered: tuple[PythonPart, ...] = ()
    below: "Joined | None" = None
    asks_outside: bool = False

    @property
    def holds_addresses(self) -> bool:
        """Whether its numbers hold addresses."""
        return bool(self.entered or self.below or self.asks_outside)


@dataclass(frozen=True, kw_only=True)
class Furnished:
    """A kernel's numbers with the addresses of what is inside it; the rest as in `Joined`."""

    gains: Array
    entered: tuple[PythonPart, ...] = ()
    below: Joined | None = None


def is_compiled(part: Any) -> bool:
    """Whether the part's law is a compiled kernel, whatever that has inside it."""
    return isinstance(getattr(part, "kernel", None), Dispatcher)


def has_state_in_python(part: Any) -> bool:
    """Whether the part is a Python object, or a kernel that enters one, or what it asks remembers."""
    outside: Any = getattr(part, "outside", None)
    remembers = outside is not None and outside.has_state
    return not hasattr(part, "kernel") or getattr(part, "inside", None) is not None or remembers


def join(part: Any, desk: Desk, signature: Any, call: Call, name: str) -> Joined:
    """A part, at its desk.

    Args:
        part: A kernel with its numbers, or a Python object.
        desk: What it works on.
        signature: Of its kind of kernel.
        call: A tick of it, where it is a Python object.
        name: What its memory is called then.
    """
    if not hasattr(part, "kernel"):
        entry = PythonPart(call, _status_of)
        return Joined(kernel=address_of(python_kernel, signature), gains=entry.gains, entered=(entry,))
    own = furnish(part, desk, name)
    if is_compiled(part):
        kernel = address_of(part.kernel, signature)
        outside = getattr(part, "outside", None) is not None
        return Joined(
            kernel=kernel, gains=own.gains, entered=own.entered, below=own.below, asks_outside=outside
        )
    entry = PythonPart(lambda: part.kernel(own.gains, desk.seen, desk.memory, desk.out), _status_of)
    return Joined(
        kernel=address_of(python_kernel, signature),
        gains=entry.gains,
        entered=(*own.entered, entry),
        below=own.below,
    )


def furnish(part: Any, desk: Desk, name: str) -> Furnished:
    """The numbers of a kernel, and in their `Head` the places of what it has inside."""
    gains, below = part.gains.copy(), None
    entered: tuple[PythonPart, ...] = ()
    if getattr(part, "inside", None) is not None:
        entry = PythonPart(part.inside.join(fields_of(desk.seen), desk.memory), _status_of)
        gains[: entry.gains.size] = entry.gains
        entered = (entry,)
    if getattr(part, "below", None) is not None:
        memory = desk.memory[desk.memory.size - memory_size(part.below) :]
        own, head = replace(desk, memory=memory), laid_over(Head, gains)
        below = join_resolver(part.below, own, f"{name}.below")
        head.below = below.kernel
        point(head.below_gains, below.gains)
        entered = (*entered, *below.entered)
    return Furnished(gains=gains, entered=entered, below=below)


def join_resolver(resolver: Any, desk: Desk, name: str) -> Joined:
    """A resolver, at its desk; see `join`."""
    signature = resolver_signature(desk.limits.q_min.size)
    return join(resolver, desk, signature, _resolver_call(resolver, desk, name), name)


def memory_size(part: Any) -> int:
    """Length of the part's memory; 0 where it is a Python object."""
    return int(getattr(part, "memory_size", 0))


def _status_of(error: BaseException) -> int:
    """The status of a tick in which a part in Python raised `error`."""
    if isinstance(error, np.linalg.LinAlgError):
        return RANK_LOST
    infeasible = isinstance(error, ControlFailure) and error.outcome is Outcome.INFEASIBLE
    return INFEASIBLE if infeasible else TOLD


def _resolver_call(resolver: Any, desk: Desk, name: str) -> Call:
    """A tick of a resolver that is a Python object."""
    seen, out, remembered = fields_of(desk.seen), fields_of(desk.out), desk.remembered

    def call() -> None:
        problem = velocity_problem_of(seen, desk.limits)
        if seen["first"][0]:
            remembered[name] = resolver.start(problem)
        found: Resolution
        found, remembered[name] = resolver.step(problem, remembered[name])
        out["qdot"][:], out["residual"][0] = found.qdot, found.residual
        if found.values.size:
            out["values"][: found.values.size] = found.values
        if found.command is not None:
            told = found.command
            out["p_WTd"][:], out["v_WTd"][:], out["a_WTd"][:] = told.p_WTd, told.v_WTd, told.a_WTd

    return call
