"""Interface of a velocity-level redundancy resolver: a Python object, or a kernel of the compiled loop."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar

import numpy as np

from surgsim.array import Array
from surgsim.catalog import Surroundings
from surgsim.columns import Block
from surgsim.control.failure import ControlFailure, Words, failure_of
from surgsim.control.inside import Elsewhere, Inside
from surgsim.control.joining import Desk, furnish
from surgsim.control.problem import Resolution, VelocityProblem
from surgsim.control.seen import seen_of_velocity
from surgsim.models.arm import ArmModel
from surgsim.tasks.base import TipCommand
from surgsim.tick.arrays import Resolved, Seen, new
from surgsim.tick.python_part import first_raised
from surgsim.tick.status import GOES_ON

Memory = TypeVar("Memory")
ResolverKernel = Callable[[Array, Seen, Array, Resolved], int]


class Resolver(Protocol[Memory]):
    """Resolves redundancy at velocity level. Its state is explicit, so a step is a pure function.

    A resolver may have `columns`, blocks that its `Resolution.values` add to the trace. Its config may say
    how many degrees of freedom it needs, see `surgsim.control.redundancy`.
    """

    def start(self, problem: VelocityProblem) -> Memory:
        """State before the first step."""
        ...

    def step(self, problem: VelocityProblem, memory: Memory) -> tuple[Resolution, Memory]:
        """Joint velocities for `problem`, and the state for the next step.

        Raises:
            ControlFailure: If there is no answer, e.g. the problem is infeasible.
            numpy.linalg.LinAlgError: If the task Jacobian has lost rank.
        """
        ...


class ResolverConfig(Protocol):
    """What a controller needs of a resolver's config."""

    @property
    def type(self) -> str:
        """Its name."""
        ...

    def check(self, scenario: Surroundings) -> None:
        """Refuse a scenario that the part does not fit.

        Raises:
            ValueError: With the reason.
        """
        ...

    def build(self, arm: ArmModel) -> Resolver[Any]:
        """The resolver for the nominal arm `arm`."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class KernelMemory:
    """Memory of a kernel with a resolver below it that is a Python object.

    Attributes:
        numbers: Of the kernel.
        remembered: What the Python object remembers, by its name.
    """

    numbers: Array
    remembered: Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class KernelResolver:
    """A resolver whose law is a kernel: the loop calls the kernel, this calls it from Python.

    Attributes:
        kernel: status = kernel(gains, seen, memory, out); compiled for `RESOLVER`, or plain Python.
        arm: The nominal arm.
        gains: The law's numbers, laid out as the kernel says; with something inside they begin with a `Head`.
        memory_size: Length of its memory, all zeros before the first step.
        columns: What it adds to the trace.
        failures: What each status of the kernel means, for the person who reads the outcome: words, or a
            function of what the kernel saw.
        examine: Arrays that let a failure be examined, from what the kernel saw and remembered.
        inside: What the kernel enters in Python.
        below: The resolver that the kernel calls; its memory is the end of this one's.
        outside: What answers the kernel from outside surgsim, to be ended with the run.
    """

    kernel: ResolverKernel
    arm: ArmModel
    gains: Array
    memory_size: int = 0
    columns: tuple[Block, ...] = ()
    failures: Mapping[int, Words] = field(default_factory=dict)
    examine: Callable[[Array, Seen, Array], Mapping[str, Array]] | None = None
    inside: Inside | None = None
    below: Resolver[Any] | None = None
    outside: Elsewhere | None = None

    def start(self, problem: VelocityProblem) -> None:
        """The kernel makes its own memory at the first step."""

    def step(self, problem: VelocityProblem, memory: Any) -> tuple[Resolution, Any]:
        """Joint velocities for one period, and the kernel's memory; None is that before the first step.

        The memory is an array (memory_size,), with a Python object below the kernel a `KernelMemory`.

        Raises:
            ControlFailure: If the kernel has no answer.
            BaseException: What a Python part inside it raised.
        """
        numbers, remembered = memory, dict[str, Any]()
        if isinstance(memory, KernelMemory):
            numbers, remembered = memory.numbers, dict(memory.remembered)
        seen = seen_of_velocity(problem, self.arm)
        seen["first"] = numbers is None
        after = np.zeros(self.memory_size) if numbers is None else numbers.copy()
        out, told = new(Resolved, problem.q.size), problem.command
        out["p_WTd"], out["v_WTd"], out["a_WTd"] = told.p_WTd, told.v_WTd, told.a_WTd
        desk = Desk(seen=seen, out=out, memory=after, limits=problem.limits, remembered=remembered)
        own = furnish(self, desk, "resolver")
        status = self.kernel(own.gains, seen, after, out)
        if status != GOES_ON:
            raise first_raised(own.entered) or self.failure(status, seen, after)
        answer = self._resolution(problem, out)
        return answer, KernelMemory(numbers=after, remembered=remembered) if remembered else after

    def failure(self, status: int, seen: Seen, memory: Array) -> ControlFailure:
        """Why there is no answer: its own, or that of the resolver below."""
        below: Any = self.below
        if status not in self.failures and below is not None and hasattr(below, "failure"):
            failure: ControlFailure = below.failure(status, seen, memory[memory.size - below.memory_size :])
            return failure
        data = {"q": seen.q.copy()} if self.examine is None else self.examine(self.gains, seen, memory)
        return failure_of(status, self.failures, data, seen)

    def _resolution(self, problem: VelocityProblem, out: Resolved) -> Resolution:
        told, width = problem.command, sum(len(block.columns) for block in self.columns)
        p, v, a = out["p_WTd"].copy(), out["v_WTd"].copy(), out["a_WTd"].copy()
        command = None
        same = (p == told.p_WTd).all() and (v == told.v_WTd).all() and (a == told.a_WTd).all()
        if not same:
            command = TipCommand(p_WTd=p, v_WTd=v, a_WTd=a, roll_rate=told.roll_rate, jaw=told.jaw)
        return Resolution(
            qdot=out["qdot"].copy(),
            residual=float(out["residual"]),
            command=command,
            values=out["values"][:width].copy(),
        )
