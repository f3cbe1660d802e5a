"""A controller: a resolver, a torque law, and the integrated joint reference between them."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import PositiveFloat

from surgsim.catalog import Name, PartConfig
from surgsim.columns import Block, vector
from surgsim.control.port_estimators import PORT_ESTIMATORS
from surgsim.control.port_estimators.base import PortEstimate, PortProblem
from surgsim.control.port_estimators.measured import MeasuredPort, MeasuredPortConfig
from surgsim.control.problem import ControlFailure, Resolution, VelocityProblem, velocity_bounds
from surgsim.control.rcm import Rcm, rcm_kinematics
from surgsim.control.resolvers import RESOLVERS
from surgsim.control.torque_laws import TORQUE_LAWS
from surgsim.control.torque_laws.base import TorqueProblem
from surgsim.errors import Outcome
from surgsim.models.arm import ArmModel, Dynamics, Kinematics
from surgsim.plant.state import State
from surgsim.tasks.base import TipCommand

Array = NDArray[np.float64]

AnyResolver: Any = RESOLVERS.union()
AnyTorqueLaw: Any = TORQUE_LAWS.union()
AnyPortEstimator: Any = PORT_ESTIMATORS.union()


class ControllerConfig(PartConfig):
    """A named pair of resolver and torque law with its gains.

    Attributes:
        name: What tables and figures call it.
        resolver: Velocity-level redundancy resolver.
        torque_law: Torque-level law; null is for the kinematic plant, which does not use one.
        port: Where the controller believes the trocar to be.
        evaluate_at: Where the resolver's kinematics are evaluated: the `measured` joint positions, or the
            integrated `reference`, as a position-controlled arm would.
        position_gain_per_s: alpha of the bounds Omega: how fast a joint may approach its position limit.
    """

    name: Name
    description: str = ""
    resolver: AnyResolver
    torque_law: AnyTorqueLaw | None = None
    port: AnyPortEstimator = MeasuredPortConfig()
    evaluate_at: Literal["measured", "reference"] = "measured"
    position_gain_per_s: PositiveFloat = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlOutput:
    """What a controller commands at a tick.

    Attributes:
        torque: Sum of the terms, not yet saturated (7,) [N m].
        terms: Each term of the torque (len(terms), 7) [N m].
        resolution: The resolver's answer.
        q_ref: Joint reference (7,) [rad].
        values: Values of the controller's own columns (k,).
    """

    torque: Array
    terms: Array
    resolution: Resolution
    q_ref: Array
    values: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class _Measured:
    """The nominal model evaluated at the measured state."""

    kin: Kinematics
    dyn: Dynamics | None
    port: PortEstimate
    rcm: Rcm | None


class Controller:
    """Runs resolver and torque law on the plant's states, one tick at a time.

    Args:
        config: Resolver, torque law and gains.
        arm: The nominal arm.
        dt_s: Control period [s].
        has_trocar: Whether states carry a trocar.
        use_torque_law: False for the kinematic plant, which follows the resolver's velocities.
    """

    def __init__(
        self, config: ControllerConfig, arm: ArmModel, *, dt_s: float, has_trocar: bool, use_torque_law: bool
    ) -> None:
        self._config = config
        self._arm = arm
        self._dt = dt_s
        self._has_trocar = has_trocar
        self._resolver = config.resolver.build(arm)
        self._port: Any = config.port.build(arm)
        self._law: Any = config.torque_law.build(arm) if use_torque_law and config.torque_law else None
        self.reset()

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of the torque law's terms."""
        return tuple(self._law.terms) if self._law else ()

    @property
    def columns(self) -> tuple[Block, ...]:
        """What resolver and port estimator add to the trace."""
        port = (vector("trocar_estimate", "m"),) if self._estimates else ()
        return (*getattr(self._resolver, "columns", ()), *port)

    @property
    def _estimates(self) -> bool:
        """Whether the trocar's place is estimated rather than taken as seen."""
        return self._has_trocar and not isinstance(self._port, MeasuredPort)

    def reset(self) -> None:
        """Forget everything: the next tick is the first."""
        self._started = False
        self._q_ref = np.zeros(7)
        self._qdot_ref = np.zeros(7)
        self._resolver_memory: Any = None
        self._law_memory: Any = None
        self._port_memory: Any = None

    def tick(self, state: State, command: TipCommand) -> ControlOutput:
        """Command for the plant's `state`.

        Raises:
            ControlFailure: If the controller has no answer.
        """
        try:
            return self._tick(state, command)
        except np.linalg.LinAlgError as error:
            raise ControlFailure(
                Outcome.INFEASIBLE, f"the task Jacobian has lost rank ({error})", {"q": state.q}
            ) from error

    def _tick(self, state: State, command: TipCommand) -> ControlOutput:
        if not self._started:
            self._q_ref, self._qdot_ref = state.q.copy(), state.v.copy()
        measured = self._evaluate(state)
        velocity = self._velocity_problem(state, command, measured)
        if not self._started:
            self._resolver_memory = self._resolver.start(velocity)
        resolution, self._resolver_memory = self._resolver.step(velocity, self._resolver_memory)
        q_ref, terms = self._q_ref, np.zeros((0, 7))
        if self._law is not None:
            problem = self._torque_problem(state, resolution.command or command, measured, resolution)
            if not self._started:
                self._law_memory = self._law.start(problem)
            terms, self._law_memory = self._law.torque(problem, self._law_memory)
        self._started = True
        self._advance_reference(resolution)
        return ControlOutput(
            torque=terms.sum(axis=0),
            terms=terms,
            resolution=resolution,
            q_ref=q_ref,
            values=np.concatenate((resolution.values, measured.port.p_WC))
            if self._estimates
            else resolution.values,
        )

    def _evaluate(self, state: State) -> "_Measured":
        """The nominal model at the measured state, once a tick."""
        if self._law is None:
            kin, dyn = self._arm.kinematics(state.q), None
        else:
            kin, dyn = self._arm.evaluate(state.q, state.v)
        port = self._estimate_port(state, kin, dyn)
        return _Measured(kin=kin, dyn=dyn, port=port, rcm=self._rcm(kin, port))

    def _estimate_port(self, state: State, kin: Kinematics, dyn: Dynamics | None) -> PortEstimate:
        problem = PortProblem(
            t_s=state.t_s,
            dt_s=self._dt,
            v=state.v,
            tau_measured=state.tau,
            kin=kin,
            dyn=dyn,
            p_WC=state.p_WC,
            v_WC=state.v_WC,
        )
        if not self._started:
            self._port_memory = self._port.start(problem)
        estimate: PortEstimate
        estimate, self._port_memory = self._port.step(problem, self._port_memory)
        return estimate

    def _velocity_problem(self, state: State, command: TipCommand, measured: "_Measured") -> VelocityProblem:
        q, v, kin, rcm = state.q, state.v, measured.kin, measured.rcm
        if self._config.evaluate_at == "reference":
            q, v = self._q_ref, self._qdot_ref
            kin = self._arm.kinematics(q)
            rcm = self._rcm(kin, measured.port)
        lower, upper = velocity_bounds(q, self._arm.limits, self._config.position_gain_per_s)
        return VelocityProblem(
            t_s=state.t_s,
            dt_s=self._dt,
            q=q,
            v=v,
            kin=kin,
            command=command,
            rcm=rcm,
            p_WC=measured.port.p_WC,
            v_WC=measured.port.v_WC,
            lower=lower,
            upper=upper,
            limits=self._arm.limits,
            position_gain_per_s=self._config.position_gain_per_s,
        )

    def _torque_problem(
        self, state: State, command: TipCommand, measured: "_Measured", resolution: Resolution
    ) -> TorqueProblem:
        assert measured.dyn is not None, "a torque law needs dynamics"
        return TorqueProblem(
            t_s=state.t_s,
            dt_s=self._dt,
            q=state.q,
            v=state.v,
            tau_measured=state.tau,
            kin=measured.kin,
            dyn=measured.dyn,
            rcm=measured.rcm,
            p_WC=measured.port.p_WC,
            v_WC=measured.port.v_WC,
            a_WC=measured.port.a_WC,
            command=command,
            resolution=resolution,
            q_ref=self._q_ref,
            f_T=state.f_T,
        )

    def _rcm(self, kin: Kinematics, port: PortEstimate) -> Rcm | None:
        return rcm_kinematics(kin, port.p_WC, port.v_WC) if self._has_trocar else None

    def _advance_reference(self, resolution: Resolution) -> None:
        self._qdot_ref = resolution.qdot
        step = self._dt * resolution.qdot
        limits = self._arm.limits
        self._q_ref = np.minimum(np.maximum(self._q_ref + step, limits.q_min), limits.q_max)
