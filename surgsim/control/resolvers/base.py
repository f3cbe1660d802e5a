"""Interface of a velocity-level redundancy resolver: a Python object, or a kernel of the compiled loop."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from surgsim.catalog import Surroundings
from surgsim.columns import Block
from surgsim.control.failure import ControlFailure, failure_of
from surgsim.control.problem import Resolution, VelocityProblem
from surgsim.control.seen import fill_velocity_problem, new_seen
from surgsim.models.arm import ArmModel
from surgsim.tasks.base import TipCommand
from surgsim.tick.arrays import Resolved, Seen, new
from surgsim.tick.status import GOES_ON

Array = NDArray[np.float64]
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


@dataclass(frozen=True, kw_only=True)
class KernelResolver:
    """A resolver whose law is a kernel: the loop calls the kernel, this calls it from Python.

    Attributes:
        kernel: status = kernel(gains, seen, memory, out); compiled for `RESOLVER`, or plain Python.
        arm: The nominal arm.
        gains: The law's numbers, laid out as the kernel says.
        memory_size: Length of its memory, all zeros before the first step.
        columns: What it adds to the trace.
        failures: What each status of the kernel means, for the person who reads the outcome: words, or a
            function of what the kernel saw.
        examine: Arrays that let a failure be examined, from what the kernel saw and remembered.
    """

    kernel: ResolverKernel
    arm: ArmModel
    gains: Array
    memory_size: int = 0
    columns: tuple[Block, ...] = ()
    failures: Mapping[int, str | Callable[[Seen], str]] = field(default_factory=dict)
    examine: Callable[[Array, Seen, Array], Mapping[str, Array]] | None = None

    def start(self, problem: VelocityProblem) -> None:
        """The kernel makes its own memory at the first step."""

    def step(self, problem: VelocityProblem, memory: Array | None) -> tuple[Resolution, Array]:
        """Joint velocities for one period, and the kernel's memory; None is that before the first step.

        Raises:
            ControlFailure: If the kernel has no answer.
        """
        seen = self.seen(problem)
        seen["first"] = memory is None
        after = np.zeros(self.memory_size) if memory is None else memory.copy()
        out, told = new(Resolved, problem.q.size), problem.command
        out["p_WTd"], out["v_WTd"], out["a_WTd"] = told.p_WTd, told.v_WTd, told.a_WTd
        status = self.kernel(self.gains, seen, after, out)
        if status != GOES_ON:
            raise self.failure(status, seen, after)
        return self._resolution(problem, out), after

    def seen(self, problem: VelocityProblem) -> Seen:
        """What the kernel sees of a problem."""
        seen = new_seen(self.arm, dt_s=problem.dt_s, has_trocar=problem.rcm is not None)
        fill_velocity_problem(seen, problem)
        return seen

    def failure(self, status: int, seen: Seen, memory: Array) -> ControlFailure:
        """Why there is no answer."""
        data = {"q": seen.q.copy()} if self.examine is None else self.examine(self.gains, seen, memory)
        told = {of: text if isinstance(text, str) else text(seen) for of, text in self.failures.items()}
        return failure_of(status, told, data)

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
