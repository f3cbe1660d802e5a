"""Joins a controller's parts, kernels or Python objects, to the arrays of its tick."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numba.core.dispatcher import Dispatcher
from numpy.typing import NDArray

from surgsim.columns import Block
from surgsim.compiled import address_of
from surgsim.control.decision import ESTIMATOR, LAW, SOLVER
from surgsim.control.failure import ControlFailure, failure_of
from surgsim.control.port_estimators.base import PortEstimate, PortEstimator, port_problem_of
from surgsim.control.problem import Resolution
from surgsim.control.resolvers.base import Resolver
from surgsim.control.seen import fill_constants, velocity_problem_of
from surgsim.control.torque_laws.base import TorqueLaw, torque_problem_of
from surgsim.errors import Outcome
from surgsim.models.arm import ArmModel
from surgsim.tick.arrays import Control, law_signature, new, point, resolver_signature
from surgsim.tick.python_part import PythonPart, python_kernel
from surgsim.tick.status import INFEASIBLE, RANK_LOST, TOLD

Array = NDArray[np.float64]


class PartArrays(NamedTuple):
    """The arrays that `surgsim.tick.arrays.Minds` says the places of, by the same names."""

    port_gains: Array
    port_memory: Array
    resolver_gains: Array
    resolver_memory: Array
    law_gains: Array
    law_memory: Array
    terms: Array


@dataclass(frozen=True, kw_only=True)
class ControllerParts:
    """A controller's parts as their configs build them: kernels with their numbers, or Python objects.

    Attributes:
        port: Port estimator.
        resolver: Resolver.
        law: Torque law; None on the kinematic plant.
    """

    port: PortEstimator[Any]
    resolver: Resolver[Any]
    law: TorqueLaw[Any] | None

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of the torque law's terms."""
        return () if self.law is None else tuple(self.law.terms)

    @property
    def columns(self) -> tuple[Block, ...]:
        """The resolver's columns."""
        return tuple(getattr(self.resolver, "columns", ()))

    def arrays(self, n: int) -> PartArrays:
        """Numbers and memories of the parts, for n joints."""
        return PartArrays(
            port_gains=_gains(self.port),
            port_memory=_memory(self.port),
            resolver_gains=_gains(self.resolver),
            resolver_memory=_memory(self.resolver),
            law_gains=_gains(self.law),
            law_memory=_memory(self.law),
            terms=np.zeros((len(self.terms), n)),
        )


def new_control(
    arm: ArmModel, *, dt_s: float, has_trocar: bool, has_law: bool, omega_gain: float, at_reference: bool
) -> Control:
    """The record of a controller's tick; `arm` must outlive it."""
    c = new(Control, arm.limits.q_min.size)
    c.has_law, c.at_reference, c.command.budget_j = has_law, at_reference, np.inf
    for seen in (c.seen, c.referred):
        fill_constants(seen, arm, dt_s=dt_s, has_trocar=has_trocar, omega_gain=omega_gain)
    arm.point(c.measured)
    arm.point(c.reference)
    return c


def _gains(part: Any) -> Array:
    """The part's numbers; one place for the address of a part that is entered in Python."""
    return part.gains.copy() if _is_compiled(part) else np.zeros(1)


def _memory(part: Any) -> Array:
    return np.zeros(getattr(part, "memory_size", 0))


def _is_compiled(part: Any) -> bool:
    return isinstance(getattr(part, "kernel", None), Dispatcher)


@dataclass(frozen=True, kw_only=True)
class Bound:
    """Parts joined to the records of a tick.

    Attributes:
        entered: The parts that are entered in Python, by the value of `Control.who`.
        parts: The parts.
        control: The record of the tick.
        arrays: Their numbers and memories.
        remembered: What the parts that are Python objects remember, by the value of `Control.who`.
    """

    entered: dict[int, PythonPart]
    parts: ControllerParts
    control: Control
    arrays: PartArrays
    remembered: dict[int, Any]

    def failure(self, status: int) -> ControlFailure:
        """Why the last tick has no answer.

        Raises:
            BaseException: What a Python part raised, if that is no failure of a controller.
        """
        who, c = int(self.control.who), self.control
        error = self.entered[who].raised() if who in self.entered else None
        if status == TOLD or error is not None:
            if isinstance(error, ControlFailure):
                return error
            if isinstance(error, np.linalg.LinAlgError):
                text = f"the task Jacobian has lost rank ({error})"
                return ControlFailure(Outcome.INFEASIBLE, text, {"q": c.seen.q.copy()})
            assert error is not None, "a Python part stopped the tick without an error"
            raise error
        seen = c.referred if who == SOLVER and c.at_reference else c.seen
        if who == SOLVER and hasattr(self.parts.resolver, "failure"):
            failure: ControlFailure = self.parts.resolver.failure(status, seen, self.arrays.resolver_memory)
            return failure
        if who == LAW and self.parts.law is not None and hasattr(self.parts.law, "failure"):
            failure = self.parts.law.failure(status, seen)
            return failure
        return failure_of(status, {}, {"q": seen.q.copy()})


def _status_of(error: BaseException) -> int:
    """The status of a tick in which a part in Python raised `error`."""
    if isinstance(error, np.linalg.LinAlgError):
        return RANK_LOST
    infeasible = isinstance(error, ControlFailure) and error.outcome is Outcome.INFEASIBLE
    return INFEASIBLE if infeasible else TOLD


def bind(parts: ControllerParts, control: Control, arm: ArmModel) -> Bound:
    """Join the parts to the record of a tick; those that are no compiled kernel are entered in Python."""
    entered: dict[int, PythonPart] = {}
    remembered: dict[int, Any] = {}
    n = arm.limits.q_min.size
    minds = parts.arrays(n)
    for name, array in minds._asdict().items():
        point(control.minds[name], array)

    def kernel(who: int, part: Any, gains: Array, call: Callable[[], int | None]) -> int:
        signature = resolver_signature(n) if who == SOLVER else law_signature(n)
        if _is_compiled(part):
            return address_of(part.kernel, signature)
        if part is not None:
            entered[who] = PythonPart(call, _status_of)
            gains[:] = entered[who].gains
        return address_of(python_kernel, signature)

    port, resolver, law = parts.port, parts.resolver, parts.law
    solve = _resolver_call(parts, control, minds, arm, remembered)
    at = control.minds
    at.port = kernel(ESTIMATOR, port, minds.port_gains, _port_call(port, control, minds, remembered))
    at.resolver = kernel(SOLVER, resolver, minds.resolver_gains, solve)
    at.law = kernel(LAW, law, minds.law_gains, _law_call(law, control, minds, remembered))
    return Bound(
        entered=entered,
        parts=parts,
        control=control,
        arrays=minds,
        remembered=remembered,
    )


def _port_call(
    port: Any, c: Control, minds: PartArrays, remembered: dict[int, Any]
) -> Callable[[], int | None]:
    if hasattr(port, "kernel"):
        return lambda: port.kernel(port.gains, c.seen, minds.port_memory, c.port)

    def call() -> None:
        problem = port_problem_of(c.seen, has_dynamics=bool(c.has_law))
        if c.seen.first:
            remembered[ESTIMATOR] = port.start(problem)
        estimate: PortEstimate
        estimate, remembered[ESTIMATOR] = port.step(problem, remembered[ESTIMATOR])
        c.port[0], c.port[1], c.port[2] = estimate.p_WC, estimate.v_WC, estimate.a_WC

    return call


def _resolver_call(
    parts: ControllerParts, c: Control, minds: PartArrays, arm: ArmModel, remembered: dict[int, Any]
) -> Callable[[], int | None]:
    resolver: Any = parts.resolver
    seen, out = c.referred if c.at_reference else c.seen, c.resolved
    limits = arm.limits
    if hasattr(resolver, "kernel"):
        return lambda: resolver.kernel(resolver.gains, seen, minds.resolver_memory, out)

    def call() -> None:
        problem = velocity_problem_of(seen, limits)
        if seen["first"]:
            remembered[SOLVER] = resolver.start(problem)
        found: Resolution
        found, remembered[SOLVER] = resolver.step(problem, remembered[SOLVER])
        out["qdot"], out["residual"] = found.qdot, found.residual
        if found.values.size:
            out["values"][: found.values.size] = found.values
        if found.command is not None:
            told = found.command
            out["p_WTd"], out["v_WTd"], out["a_WTd"] = told.p_WTd, told.v_WTd, told.a_WTd

    return call


def _law_call(
    law: Any, c: Control, minds: PartArrays, remembered: dict[int, Any]
) -> Callable[[], int | None]:
    if hasattr(law, "kernel"):
        return lambda: law.kernel(law.gains, c.seen, minds.law_memory, minds.terms)

    def call() -> None:
        out = c.resolved
        resolution = Resolution(qdot=out.qdot.copy(), residual=float(out.residual), values=out.values.copy())
        problem = torque_problem_of(c.seen, resolution)
        if c.seen.first:
            remembered[LAW] = law.start(problem)
        minds.terms[:], remembered[LAW] = law.torque(problem, remembered[LAW])

    return call
