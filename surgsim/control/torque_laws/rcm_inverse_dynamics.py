"""RCM inverse dynamics: ours. RCM over tip over posture at acceleration level, disturbances rejected."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, NonNegativeFloat, PositiveFloat

from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.control.acceleration import AccelerationLimits, PriorityProgram
from surgsim.control.manipulability import velocity_product_accelerations
from surgsim.control.observer import DelayEstimate, DisturbanceObserver, ObserverState
from surgsim.control.rcm import rcm_bias_acceleration, rcm_kinematics
from surgsim.control.torque_laws.base import TorqueProblem
from surgsim.models.arm import ArmModel, Dynamics, Kinematics

Array = NDArray[np.float64]
_ORDERS = np.array([2.0, 1.0, 2.0, 1.0, 2.0, 1.0])
"""How stiffness and damping gains go with the bandwidth."""


class RcmInverseDynamicsConfig(PartConfig):
    """Inverse dynamics of RCM, tip and posture in strict priority, with a disturbance observer.

    Attributes:
        rcm_stiffness_per_s2: Proportional gain of the RCM error, per unit mass [1/s^2].
        rcm_damping_ratio: Damping of the RCM error's second-order dynamics.
        tip_stiffness_per_s2: Proportional gain of the tip error [1/s^2].
        tip_damping_ratio: Damping of the tip error's dynamics.
        joint_stiffness_per_s2: Gain about the joint reference in the remaining null space [1/s^2].
        joint_damping_ratio: Damping there.
        observer_gain: Share of a period's unexplained velocity change that the disturbance observer takes
            in; 0 switches it off.
        most_delay_ticks: Longest actuation delay that is recognised and predicted over; 0 switches the
            prediction off.
        full_gain_delay_s: Longest recognised delay at which all gains are whole; past it bandwidths fall as
            its inverse [s].
        sensor_delay_s: Part of the recognised delay that is known to be the sensors': the command, which is
            of now, is not carried over it [s].
        contact: What becomes of the measured force on the tip: `reject` lets the observer cancel it like
            any disturbance; `yield` cancels it too, but for the tip's acceleration along it, so that the tip
            is an impedance towards what it touches.
    """

    type: Literal["rcm_inverse_dynamics"] = "rcm_inverse_dynamics"
    rcm_stiffness_per_s2: PositiveFloat = 2e4
    rcm_damping_ratio: PositiveFloat = 1.0
    tip_stiffness_per_s2: PositiveFloat = 1e4
    tip_damping_ratio: PositiveFloat = 1.0
    joint_stiffness_per_s2: NonNegativeFloat = 100.0
    joint_damping_ratio: NonNegativeFloat = 1.0
    observer_gain: Annotated[float, Field(ge=0.0, le=1.0)] = 0.3
    most_delay_ticks: Annotated[int, Field(ge=0, le=1000)] = 20
    full_gain_delay_s: PositiveFloat = 0.01
    sensor_delay_s: NonNegativeFloat = 0.0
    contact: Literal["reject", "yield"] = "reject"

    def build(self, arm: ArmModel) -> "RcmInverseDynamics":
        """The law."""
        return RcmInverseDynamics(self, arm)


@dataclass(frozen=True, slots=True, kw_only=True)
class InverseDynamicsMemory:
    """State of the law: what the observer and the delay estimate carry."""

    observer: ObserverState
    delay: DelayEstimate


class RcmInverseDynamics:
    """tau = M q'' + bias + D q' - d, at the state predicted for when the torque will act.

    The accelerations ask for second-order error dynamics,

        J_rcm q'' = N C'' - b_rcm - k_r e - 2 z_r sqrt(k_r) e'
        J_T q''   = a_d - J_T' q' + 2 z_t sqrt(k_t) (v_d - v) + k_t (p_d - p)
        q''       = k_q (q_ref - q) + 2 z_q sqrt(k_q) (q_ref' - q')        in the null space of both

    solved in closed form with the inertia-weighted inverse: where [J_T; J_rcm] has full rank, no row has to
    give way. If that answer would pass a torque limit, or a velocity from which a joint cannot stop before
    its limit, a cascade of quadratic programs keeps the limits and lets the posture give way first, then the
    tip, and the RCM last (`PriorityProgram`).

    d is the disturbance torque that `DisturbanceObserver` infers from measured torque and motion: payload,
    friction, wrong inertia, pushes. It is fed by the measured torque, so that saturation and late torques do
    not wind it up, less the slow mean by which measured and commanded torque differ: a biased drive or
    sensor. With `contact: yield` the measured force f on the tip is not left to the observer. It is cancelled
    at once, and the tip is asked for the acceleration along f that it would take under it with the shaft held
    in the trocar,

        a_T += f (f' P f) / (f' f),    P the tip's mobility with the RCM held (3, 3) [1/kg],

    so that RCM, posture and the tip across f do not give way.

    An actuation delay shows as the lag of measured behind commanded torque (`DelayEstimate`); the law then
    acts on the state predicted with the torques still on their way, which is why stiff gains survive it. Past
    `full_gain_delay_s` the prediction is no longer good enough: bandwidths and observer gain fall as its
    inverse.

    Source: ours; the hierarchy is operational-space control (Khatib 1987), the observer the discrete form of
    a momentum observer (De Luca et al. 2006), the prediction one of the state over the dead time.
    """

    terms = ("tip", "rcm", "joint", "bias", "observer", "limits")

    def __init__(self, config: RcmInverseDynamicsConfig, arm: ArmModel) -> None:
        self._c = config
        self._arm = arm
        self._damping = arm.damping
        self._limits = AccelerationLimits(arm.limits)
        self._priority = PriorityProgram()
        self._observer = DisturbanceObserver(config.observer_gain, arm.damping)
        c = config
        self._gains = np.array(
            [
                c.rcm_stiffness_per_s2,
                2.0 * c.rcm_damping_ratio * c.rcm_stiffness_per_s2**0.5,
                c.tip_stiffness_per_s2,
                2.0 * c.tip_damping_ratio * c.tip_stiffness_per_s2**0.5,
                c.joint_stiffness_per_s2,
                2.0 * c.joint_damping_ratio * c.joint_stiffness_per_s2**0.5,
            ]
        )

    def start(self, problem: TorqueProblem) -> InverseDynamicsMemory:
        """No disturbance known, no delay; the limits' programs forget their active sets."""
        self._priority = PriorityProgram()
        return InverseDynamicsMemory(
            observer=self._observer.start(), delay=DelayEstimate.start(self._c.most_delay_ticks)
        )

    def torque(
        self, problem: TorqueProblem, memory: InverseDynamicsMemory
    ) -> tuple[Array, InverseDynamicsMemory]:
        """Rows tip, rcm, joint, bias, observer, limits (6, 7) [N m]."""
        p = problem
        delay = memory.delay.update(p.tau_measured, p.dt_s)
        late_s = delay.ticks * p.dt_s
        share = min(1.0, self._c.full_gain_delay_s / late_s) if delay.ticks else 1.0
        touch = p.f_T @ p.kin.Jv_WT if self._c.contact == "yield" else np.zeros(7)
        observer = self._observer.update(memory.observer, p, share, delay.offset - touch)
        d = observer.disturbance + touch
        q, v, kin, dyn = p.q, p.v, p.kin, p.dyn
        if delay.ticks:
            q, v = predict(p, delay.in_flight, d, self._damping)
            kin, dyn = self._arm.evaluate(q, v)
        terms = self._terms(p, q, v, kin, dyn, late_s, d, share)
        limit = self._arm.limits.torque
        sent = np.minimum(np.maximum(terms.sum(axis=0), -limit), limit)
        return terms, InverseDynamicsMemory(observer=observer, delay=delay.sent(sent))

    def _terms(
        self,
        p: TorqueProblem,
        q: Array,
        v: Array,
        kin: Kinematics,
        dyn: Dynamics,
        late_s: float,
        d: Array,
        share: float,
    ) -> Array:
        """Terms of the torque for the state (q, v) that is reached `late_s` from now."""
        k, command = self._gains * share**_ORDERS, p.command
        linear, angular = velocity_product_accelerations(kin, v)
        ahead_s = max(late_s - self._c.sensor_delay_s, 0.0)
        p_d = command.p_WTd + ahead_s * (command.v_WTd + 0.5 * ahead_s * command.a_WTd)
        v_d = command.v_WTd + ahead_s * command.a_WTd
        a_tip = command.a_WTd - linear + k[3] * (v_d - kin.Jv_WT @ v) + k[2] * (p_d - kin.p_WT)
        J, a = kin.Jv_WT, a_tip
        if p.rcm is not None:
            p_WC = p.p_WC + late_s * (p.v_WC + 0.5 * late_s * p.a_WC)
            v_WC = p.v_WC + late_s * p.a_WC
            rcm = rcm_kinematics(kin, p_WC, v_WC)
            bias = rcm_bias_acceleration(kin, v, p_WC, v_WC, linear, angular) - rcm.normals @ p.a_WC
            e_dot = rcm.jacobian @ v - rcm.trocar_velocity
            J = np.concatenate((J, rcm.jacobian))
            a = np.concatenate((a, -bias - k[0] * rcm.error - k[1] * e_dot))
        if self._c.contact == "yield" and p.f_T.any():
            a[:3] += _giving_way(dyn.mass_matrix, J, p.f_T)
        qdot_ref = p.resolution.qdot
        posture = k[4] * (p.q_ref + ahead_s * qdot_ref - q) + k[5] * (qdot_ref - v)
        constant = dyn.bias + self._damping * v - d
        terms, qddot = _inverse_dynamics(dyn.mass_matrix, J, a, posture)
        terms[3] = dyn.bias + self._damping * v
        terms[4] = -d
        low, high = self._limits.bounds(q, v, p.dt_s)
        if not self._limits.allows(dyn.mass_matrix @ qddot + constant, qddot, low, high):
            kept = self._priority.solve(dyn.mass_matrix, constant, J, a, posture, low, high, self._limits)
            terms[5] = dyn.mass_matrix @ (kept - qddot)
        return terms


def predict(p: TorqueProblem, in_flight: Array, d: Array, damping: Array) -> tuple[Array, Array]:
    """Joint state after the torques `in_flight` (n, 7) [N m] have acted, one a period.

    Semi-implicit Euler with the inertia and bias of the present state, which change little over a few
    milliseconds.

    Returns:
        Positions (7,) [rad] and velocities (7,) [rad/s].
    """
    return _predict(p.q, p.v, p.dyn.mass_matrix, p.dyn.bias - d, damping, in_flight, p.dt_s)


@compiled
def _predict(
    q: Array, v: Array, M: Array, bias: Array, damping: Array, in_flight: Array, dt: float
) -> tuple[Array, Array]:
    implicit = M + dt * np.diag(damping)
    for i in range(in_flight.shape[0]):
        v = v + dt * np.linalg.solve(implicit, in_flight[i] - bias - damping * v)
        q = q + dt * v
    return q, v


@compiled
def _giving_way(M: Array, J: Array, f: Array) -> Array:
    """Acceleration of the tip (3,) along the force `f` on it, the further rows of `J` held."""
    held = np.ascontiguousarray(np.linalg.inv(J @ np.linalg.solve(M, J.T))[:3, :3])
    return f * (f @ np.linalg.solve(held, f)) / (f @ f)


@compiled
def _inverse_dynamics(M: Array, J: Array, a: Array, posture: Array) -> tuple[Array, Array]:
    """Terms (6, 7) of M q'' [N m], the last three zero, and q'' (7,) with J q'' = a nearest to `posture`."""
    MinvJT = np.linalg.solve(M, J.T)
    force = np.linalg.solve(J @ MinvJT, a - J @ posture)
    terms = np.zeros((6, 7))
    terms[0] = force[:3] @ J[:3]
    terms[1] = force[3:] @ J[3:]
    terms[2] = M @ posture
    return terms, posture + MinvJT @ force
