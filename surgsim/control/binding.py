"""Joins a controller's parts, kernels or Python objects, to the arrays of its tick."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from surgsim.array import Array
from surgsim.columns import Block
from surgsim.compiled import address_of
from surgsim.control.decision import ESTIMATOR, INSTRUMENT, LAW, SOLVER
from surgsim.control.failure import ControlFailure, failure_of
from surgsim.control.instrument_estimators.base import (
    Correction,
    InstrumentEstimator,
    instrument_problem_of,
)
from surgsim.control.joining import Call, Desk, Joined, join, join_resolver, memory_size
from surgsim.control.port_estimators.base import PortEstimate, PortEstimator, port_problem_of
from surgsim.control.problem import Resolution
from surgsim.control.resolvers.base import Resolver
from surgsim.control.seen import fill_constants
from surgsim.control.torque_laws.base import TorqueLaw, torque_problem_of
from surgsim.errors import Outcome
from surgsim.models.arm import ArmModel
from surgsim.tick.arrays import Control, Resolved, Seen, law_signature, new, point
from surgsim.tick.fields import fields_of
from surgsim.tick.python_part import first_raised, python_kernel
from surgsim.tick.status import TOLD


class PartArrays(NamedTuple):
    """The arrays that `surgsim.tick.arrays.Minds` says the places of, by the same names."""

    instrument_gains: Array
    instrument_memory: Array
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
        instrument: Instrument estimator.
        port: Port estimator.
        resolver: Resolver.
        law: Torque law; None on the kinematic plant.
    """

    instrument: InstrumentEstimator[Any]
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


def new_control(
    arm: ArmModel,
    *,
    dt_s: float,
    has_trocar: bool,
    has_law: bool,
    corrects: bool,
    omega_gain: float,
    limit_zone_rad: float,
    adds_avoidance: bool,
    at_reference: bool,
    commands_reference: bool = False,
) -> Control:
    """The record of a controller's tick; `arm` must outlive it."""
    c = new(Control, arm.limits.q_min.size)
    c.has_law, c.at_reference, c.corrects = has_law, at_reference, corrects
    c.commands_reference = commands_reference
    c.command.budget_j, c.adds_avoidance = np.inf, adds_avoidance
    for seen in (c.seen, c.referred):
        fill_constants(
            seen,
            arm,
            dt_s=dt_s,
            has_trocar=has_trocar,
            omega_gain=omega_gain,
            limit_zone_rad=limit_zone_rad,
        )
    arm.point(c.measured)
    arm.point(c.reference)
    return c


@dataclass(frozen=True, kw_only=True)
class Bound:
    """Parts joined to the records of a tick.

    Attributes:
        parts: The parts.
        control: The record of the tick.
        arrays: Their numbers and memories.
        joined: The parts as the tick calls them, by the value of `Control.who`.
        remembered: What the parts that are Python objects remember, by their names.
    """

    parts: ControllerParts
    control: Control
    arrays: PartArrays
    joined: dict[int, Joined]
    remembered: dict[str, Any]

    @property
    def entered(self) -> tuple[int, ...]:
        """The parts that Python is entered for, by the value of `Control.who`."""
        return tuple(who for who, part in self.joined.items() if part.entered)

    @property
    def addressed(self) -> tuple[int, ...]:
        """The parts whose numbers hold addresses, by the value of `Control.who`."""
        return tuple(who for who, part in self.joined.items() if part.holds_addresses)

    def forget_instrument(self) -> None:
        """Nothing is known of the instrument but the nominal model."""
        c = self.control
        self.arrays.instrument_memory[:] = 0.0
        self.remembered.pop("instrument", None)
        c.correction[:] = 0.0
        for model in (c.measured, c.reference, c.seen.elsewhere, c.referred.elsewhere):
            model.corrected = 0

    def failure(self, status: int) -> ControlFailure:
        """Why the last tick has no answer.

        Raises:
            BaseException: What a Python part raised, if that is no failure of a controller.
        """
        who, c = int(self.control.who), self.control
        error = first_raised(self.joined[who].entered)
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


def bind(parts: ControllerParts, control: Control, arm: ArmModel) -> Bound:
    """Join the parts to the record of a tick; those that are no compiled kernel are entered in Python."""
    c, n, remembered = control, arm.limits.q_min.size, dict[str, Any]()
    terms = np.zeros((len(parts.terms), n))

    def desk(part: Any, seen: Seen, out: Any) -> Desk:
        memory = np.zeros(memory_size(part))
        return Desk(seen=seen, out=out, memory=memory, limits=arm.limits, remembered=remembered)

    at_instrument = desk(parts.instrument, c.seen, c.correction)
    at_port = desk(parts.port, c.seen, c.port)
    at_resolver = desk(parts.resolver, c.referred if c.at_reference else c.seen, c.resolved)
    at_law, signature = desk(parts.law, c.seen, terms), law_signature(n)
    call = _instrument_call(parts.instrument, at_instrument)
    instrument = join(parts.instrument, at_instrument, signature, call, "instrument")
    call = _port_call(parts.port, at_port, has_dynamics=bool(c.has_law))
    port = join(parts.port, at_port, signature, call, "port")
    resolver = join_resolver(parts.resolver, at_resolver, "resolver")
    law = Joined(kernel=address_of(python_kernel, signature), gains=np.zeros(1))
    if parts.law is not None:
        law = join(parts.law, at_law, signature, _law_call(parts.law, at_law, c.resolved), "law")
    minds = PartArrays(
        instrument_gains=instrument.gains,
        instrument_memory=at_instrument.memory,
        port_gains=port.gains,
        port_memory=at_port.memory,
        resolver_gains=resolver.gains,
        resolver_memory=at_resolver.memory,
        law_gains=law.gains,
        law_memory=at_law.memory,
        terms=terms,
    )
    for name, array in minds._asdict().items():
        point(c.minds[name], array)
    c.minds.instrument, c.minds.port = instrument.kernel, port.kernel
    c.minds.resolver, c.minds.law = resolver.kernel, law.kernel
    joined = {ESTIMATOR: port, SOLVER: resolver, LAW: law, INSTRUMENT: instrument}
    return Bound(parts=parts, control=control, arrays=minds, joined=joined, remembered=remembered)


def _instrument_call(instrument: Any, desk: Desk) -> Call:
    """A tick of an instrument estimator that is a Python object."""
    seen, out, remembered = fields_of(desk.seen), desk.out, desk.remembered

    def call() -> None:
        problem = instrument_problem_of(seen)
        if "instrument" not in remembered:
            remembered["instrument"] = instrument.start(problem)
        correction: Correction
        correction, remembered["instrument"] = instrument.step(problem, remembered["instrument"])
        out[0], out[1] = correction.linear, correction.angular

    return call


def _port_call(port: Any, desk: Desk, *, has_dynamics: bool) -> Call:
    """A tick of a port estimator that is a Python object."""
    seen, out, remembered = fields_of(desk.seen), desk.out, desk.remembered

    def call() -> None:
        problem = port_problem_of(seen, has_dynamics=has_dynamics)
        if seen["first"][0]:
            remembered["port"] = port.start(problem)
        estimate: PortEstimate
        estimate, remembered["port"] = port.step(problem, remembered["port"])
        out[0], out[1], out[2] = estimate.p_WC, estimate.v_WC, estimate.a_WC

    return call


def _law_call(law: TorqueLaw[Any], desk: Desk, resolved: Resolved) -> Call:
    """A tick of a torque law that is a Python object."""
    seen, answer, remembered = fields_of(desk.seen), fields_of(resolved), desk.remembered

    def call() -> None:
        qdot, residual, values = answer["qdot"], answer["residual"], answer["values"]
        resolution = Resolution(qdot=qdot.copy(), residual=residual.item(), values=values.copy())
        problem = torque_problem_of(seen, resolution)
        if seen["first"][0]:
            remembered["law"] = law.start(problem)
        desk.out[:], remembered["law"] = law.torque(problem, remembered["law"])

    return call
