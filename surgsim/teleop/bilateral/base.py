"""Interface of a bilateral scheme: one record for either end, and three kernels that work on it.

All is in the axes and the scale of the tip: a handle that moves by d stands for a motion s R_WO d of the tip,
and a force f on it for s R_WO^T f on the handle, so that power is the same on both
(`surgsim.teleop.mapping`). With the scale s = 0.5 a hand of 135 N/m is one of 540 N/m there, and a handle of
0.3 kg one of 1.2 kg.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Any, ClassVar, Protocol

import numba
import numpy as np
from numba import types
from numba.core.dispatcher import Dispatcher

from surgsim.array import Array
from surgsim.errors import SurgsimError
from surgsim.teleop.messages import CONTENT
from surgsim.tick.arrays import A1, Record, type_of
from surgsim.tick.overlay import laid_over, overlay, take


class End(Record):
    """One end of the channel: what a scheme sees there, and what it answers.

    Attributes:
        t_s: Time [s].
        period_s: Control period h [s].
        known: Whether anything has been received.
        fresh: Whether a newer message came in this period.
        trust: In the newest message, from 0 to 1: it fades while nothing arrives.
        received: The newest message of the other end, twelve numbers as in `surgsim.teleop.messages`.
        received_j: Energy that came in this period [J].
        position: Of the handle, as the tip that it stands for, or of the tip (3,) [m].
        velocity: The same (3,) [m/s].
        force: Of the hand on the handle over the last period, or of the tip on its surroundings (3,) [N].
        work_j: What the rendered force gave the hand over the period, or the tip its surroundings [J]. In
            `feel` it is that of the last period, in `tell` of this one, in `follow` of the last.
        mobility_per_kg: Largest inverse mass that a force on the handle meets [1/kg]; 0 at the remote end.
        command: Answer: force on the handle (3,) [N], or velocity of the tip (3,) [m/s].
        content: Answer: the message, twelve numbers; the places of jaw and roll are filled by others.
        energy_j: Answer: energy to be sent with it, not negative [J].
        stored_j: Answer: energy in stock at this end, without what is sent now [J].
        burnt_j: Answer: energy given up so far [J].
        deficit_j: Answer: energy taken though there was none [J].
        observed_j: Answer: what is left of the energy that has come, by the scheme's own book [J].
    """

    SHAPES: ClassVar[dict[str, str]] = {
        **{name: "3" for name in ("position", "velocity", "force", "command")},
        **{name: str(CONTENT) for name in ("received", "content")},
    }
    t_s: float
    period_s: float
    known: int
    fresh: int
    trust: float
    received: Array
    received_j: float
    position: Array
    velocity: Array
    force: Array
    work_j: float
    mobility_per_kg: float
    command: Array
    content: Array
    energy_j: float
    stored_j: float
    burnt_j: float
    deficit_j: float
    observed_j: float


EndKernel = Callable[[Array, End, Array], int]


@cache
def end_signature() -> Any:
    """Status = kernel(gains, end, memory)."""
    return types.int64(A1, type_of(End, 0), A1)


@dataclass(frozen=True, kw_only=True)
class BilateralScheme:
    """A scheme as the loop calls it: compiled kernels `status = kernel(gains, end, memory)`.

    Either end has its own memory, all zeros at first. Laws are pure: what they remember is in the memory.

    Attributes:
        feel: At the operator's end, before the handle moves: `command` is the force on it.
        tell: There, afterwards: message and energy.
        follow: At the remote end: `command` is the tip's velocity; message and energy.
        gains: The scheme's numbers.
        memory_size: Length of the memory of each end.
    """

    feel: EndKernel
    tell: EndKernel
    follow: EndKernel
    gains: Array = field(default_factory=lambda: np.zeros(1))
    memory_size: int = 1


class BilateralConfig(Protocol):
    """What a task needs of a scheme's config."""

    @property
    def type(self) -> str:
        """Its name."""
        ...

    def build(self, period_s: float, round_trip_s: float) -> BilateralScheme | None:
        """The scheme for a control period and a round trip [s]; None: `passive_convex`, the task's own."""
        ...


def compiled_only(kernel: Any, name: str) -> Any:
    """`kernel`, if the loop can call it.

    Raises:
        SurgsimError: If it is a function of Python that is not compiled.
    """
    if not isinstance(kernel, Dispatcher) and not vars(numba.config)["DISABLE_JIT"]:
        raise SurgsimError(f"a bilateral scheme's kernel '{name}' must be compiled: put @compiled above it")
    return kernel


def numbers(kind: Any, config: object) -> Array:
    """Gains laid out as the record `kind`, filled from `config` by name, records in it too.

    Example:
        `numbers(Law, config)[:SIZE].view(LAW)[0].stiffness_n_per_m` is `config.stiffness_n_per_m`.
    """
    gains = np.zeros(overlay(kind)[1])
    law: Any = laid_over(kind, gains)
    take(law, config)
    for name in law.dtype.names:
        if law.dtype[name].names and hasattr(config, name):
            take(law[name], getattr(config, name))
    return gains
