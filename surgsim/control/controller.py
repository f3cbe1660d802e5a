"""A controller: a resolver, a torque law, and the integrated joint reference between them."""

from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.catalog import Name, PartConfig, Surroundings
from surgsim.columns import Block, vector, width
from surgsim.compiled import as_parameter
from surgsim.control.binding import ControllerParts, bind, new_control
from surgsim.control.decision import decide, decide_signature, forget
from surgsim.control.failure import ControlFailure
from surgsim.control.instrument_estimators import INSTRUMENT_ESTIMATORS
from surgsim.control.instrument_estimators.base import InstrumentEstimatorConfig, fill_tracked
from surgsim.control.instrument_estimators.nominal import NominalInstrumentConfig
from surgsim.control.joining import has_state_in_python
from surgsim.control.port_estimators import PORT_ESTIMATORS
from surgsim.control.port_estimators.base import PortEstimatorConfig
from surgsim.control.port_estimators.measured import MeasuredPortConfig
from surgsim.control.problem import Resolution
from surgsim.control.redundancy import check_redundancy, follows_roll, shares_null_space
from surgsim.control.resolvers import RESOLVERS
from surgsim.control.resolvers.base import ResolverConfig
from surgsim.control.torque_laws import TORQUE_LAWS
from surgsim.control.torque_laws.base import TorqueLawConfig
from surgsim.models.arm import ArmModel
from surgsim.plant.state import State
from surgsim.tasks.base import TipCommand
from surgsim.tasks.command import command_of, fill_command
from surgsim.tick.status import GOES_ON

if TYPE_CHECKING:  # what a controller may use of a part, whichever it is
    AnyResolver = ResolverConfig
    AnyTorqueLaw = TorqueLawConfig
    AnyPortEstimator = PortEstimatorConfig
    AnyInstrumentEstimator = InstrumentEstimatorConfig
else:
    AnyResolver, AnyTorqueLaw = RESOLVERS.union(), TORQUE_LAWS.union()
    AnyPortEstimator = PORT_ESTIMATORS.union()
    AnyInstrumentEstimator = INSTRUMENT_ESTIMATORS.union()


class ControllerConfig(PartConfig):
    """A named pair of resolver and torque law with its gains.

    Attributes:
        name: What tables and figures call it.
        resolver: Velocity-level redundancy resolver.
        torque_law: Torque-level law; null is for the kinematic plant, which does not use one.
        port: Where the controller believes the trocar to be.
        instrument: Where it believes the instrument to be, given the joint positions.
        evaluate_at: Where the resolver's kinematics are evaluated: the `measured` joint positions, or the
            integrated `reference`, as a position-controlled arm would.
        position_gain_per_s: alpha of the bounds Omega: how fast a joint may approach its position limit.
        limit_zone_rad: Within this of the end of a joint's range, null-space motion leads away from it: it is
            added to the answer of a resolver that shares its null space, and part of the objective of one
            that solves a program; 0: none [rad].
    """

    name: Name
    description: str = ""
    resolver: AnyResolver
    torque_law: AnyTorqueLaw | None = None
    port: AnyPortEstimator = MeasuredPortConfig()
    instrument: AnyInstrumentEstimator = NominalInstrumentConfig()
    evaluate_at: Literal["measured", "reference"] = "measured"
    position_gain_per_s: PositiveFloat = 10.0
    limit_zone_rad: NonNegativeFloat = 0.2

    def check(self, scenario: Surroundings) -> None:
        """Refuse a scenario that one of the parts does not fit, or whose roll no part follows."""
        if scenario.rolls_instrument and not (follows_roll(self.resolver) or follows_roll(self.torque_law)):
            raise ValueError(
                f"the task rolls the instrument, and resolver '{self.resolver.type}' leaves the roll free: "
                "passive_qp and vector_field_inequalities follow it"
            )
        for part in (self.resolver, self.torque_law, self.port, self.instrument):
            if part is not None:
                part.check(scenario)


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlOutput:
    """What a controller commands at a tick.

    Attributes:
        torque: Sum of the terms, not yet saturated (n,) [N m].
        terms: Each term of the torque (len(terms), n) [N m].
        resolution: The resolver's answer.
        q_ref: Joint reference (n,) [rad].
        values: Values of the controller's own columns (k,).
    """

    torque: Array
    terms: Array
    resolution: Resolution
    q_ref: Array
    values: Array


class Controller:
    """Estimators, resolver and torque law on a plant's measured states, one tick at a time.

    The tick itself is the kernel `surgsim.control.decision.decide`; this builds its arrays and calls it.

    Args:
        config: Resolver, torque law and gains.
        arm: The nominal arm.
        dt_s: Control period [s].
        has_trocar: Whether states carry a trocar.
        use_torque_law: False for the kinematic plant, which follows the resolver's velocities.

    Raises:
        SurgsimError: If a part needs more redundancy than the arm has, or cannot be built for it.

    Attributes:
        control: The record that `decide` works on.
        parts: Estimators, resolver and torque law as their configs build them.
        estimates: Whether the trocar's place is estimated rather than taken as seen.
    """

    def __init__(
        self, config: ControllerConfig, arm: ArmModel, *, dt_s: float, has_trocar: bool, use_torque_law: bool
    ) -> None:
        self._config, self._arm, self._dt, self._has_trocar = config, arm, dt_s, has_trocar
        used = (config.resolver, config.torque_law) if use_torque_law else (config.resolver,)
        for part in used:
            check_redundancy(part, arm, has_trocar)
        self._join(
            ControllerParts(
                instrument=config.instrument.build(arm),
                port=config.port.build(arm),
                resolver=config.resolver.build(arm),
                law=config.torque_law.build(arm) if use_torque_law and config.torque_law else None,
            )
        )

    def _join(self, parts: ControllerParts) -> None:
        """Join the parts to new records."""
        arm, config, has_trocar = self._arm, self._config, self._has_trocar
        self.parts = parts
        self.estimates = has_trocar and getattr(self.parts.port, "estimates", True)
        self.control = new_control(
            arm,
            dt_s=self._dt,
            has_trocar=has_trocar,
            has_law=self.parts.law is not None,
            corrects=getattr(self.parts.instrument, "corrects", True),
            omega_gain=config.position_gain_per_s,
            limit_zone_rad=config.limit_zone_rad,
            adds_avoidance=shares_null_space(config.resolver),
            at_reference=config.evaluate_at == "reference",
            commands_reference=getattr(parts.law, "commands_reference", False),
        )
        self._bound = bind(self.parts, self.control, arm)
        self._decide = as_parameter(decide, decide_signature(arm.limits.q_min.size))
        self.reset()

    def with_parts(self, parts: ControllerParts) -> "Controller":
        """The same controller with other parts."""
        other = copy(self)
        other._join(parts)
        return other

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of the torque law's terms."""
        return self.parts.terms

    @property
    def columns(self) -> tuple[Block, ...]:
        """What resolver and port estimator add to the trace."""
        port = (vector("trocar_estimate", "m"),) if self.estimates else ()
        return (*self.parts.columns, *port)

    @property
    def objects(self) -> dict[str, object]:
        """What of the controller is a Python object with a state, by name."""
        p = self.parts
        parts = {"instrument": p.instrument, "port": p.port, "resolver": p.resolver, "torque_law": p.law}
        named = {f"controller.{name}": part for name, part in parts.items() if has_state_in_python(part)}
        return {**named, "controller's memory": self._bound.remembered}

    @property
    def arrays(self) -> dict[str, Array]:
        """The parts' numbers and memories, without addresses."""
        names = ("port_gains", "resolver_gains", "law_gains", "instrument_gains")
        held = {names[who] for who in self._bound.addressed}
        return {name: a for name, a in self._bound.arrays._asdict().items() if name not in held}

    @property
    def is_compiled(self) -> bool:
        """Whether all its parts are compiled kernels that enter no Python."""
        return not self._bound.entered

    def close(self) -> None:
        """End what answers from outside surgsim; the controller cannot be asked afterwards."""
        for part in (self.parts.resolver, self.parts.law):
            while part is not None:
                outside = getattr(part, "outside", None)
                if outside is not None:
                    outside.close()
                part = getattr(part, "below", None)

    def reset(self) -> None:
        """Forget everything: the next tick is the first."""
        forget(self.control)
        self._bound.forget_instrument()

    def tick(self, state: State, command: TipCommand) -> ControlOutput:
        """Command for the plant's `state`.

        Raises:
            ControlFailure: If the controller has no answer.
        """
        seen = self.control.seen
        seen.t_s, seen.q[:], seen.v[:] = state.t_s, state.q, state.v
        seen.tau[:], seen.f_T[:] = state.tau, state.f_T
        seen.p_WC[:], seen.v_WC[:], seen.a_WC[:] = state.p_WC, state.v_WC, 0.0
        fill_tracked(seen, state.tracked)
        fill_command(self.control.command, command)
        status = self._decide(self.control)
        if status != GOES_ON:
            raise self.failure(status)
        return self._output()

    def failure(self, status: int) -> ControlFailure:
        """Why the last tick has no answer; what a Python part raised other than that is raised here."""
        return self._bound.failure(status)

    def _output(self) -> ControlOutput:
        c, out = self.control, self.control.resolved
        own = out.values[: width(self.parts.columns)].copy()
        resolution = Resolution(
            qdot=out.qdot.copy(), residual=float(out.residual), command=command_of(c.seen), values=own
        )
        return ControlOutput(
            torque=c.torque.copy(),
            terms=self._bound.arrays.terms.copy(),
            resolution=resolution,
            q_ref=c.q_ref.copy(),
            values=np.concatenate((own, c.port[0])) if self.estimates else own,
        )
