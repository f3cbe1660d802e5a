"""Interface of a velocity-level redundancy resolver."""

from typing import Protocol, TypeVar

from surgsim.control.problem import Resolution, VelocityProblem

Memory = TypeVar("Memory")


class Resolver(Protocol[Memory]):
    """Resolves redundancy at velocity level. Its state is explicit, so a step is a pure function.

    A resolver may have `columns`, blocks that its `Resolution.values` add to the trace.
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
