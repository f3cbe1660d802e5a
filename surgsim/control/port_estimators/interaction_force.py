"""Interaction force: a trocar that nobody measures, inferred from what the wall does to the shaft."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, NonNegativeFloat, PositiveFloat

from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.control.observer import DisturbanceObserver, ObserverState
from surgsim.control.port_estimators.base import PortEstimate, PortProblem
from surgsim.control.rcm import rcm_kinematics
from surgsim.models.arm import ArmModel

Array = NDArray[np.float64]
_ADVANCE = 0.25 * math.pi


class InteractionForceConfig(PartConfig):
    """Lets the estimated trocar give way to the lateral force on the shaft, until there is none.

    Attributes:
        compliance_m_per_n_s: Gain: speed of the estimate per newton [m/(N s)].
        observer_gain: Share of a period's unexplained velocity change that the force estimate takes in.
        tare_s: The mean force over this first time is what payload and friction do, and is taken off; so
            long the shaft must hang free in the port, as a wall that presses on it is taken off too [s].
        threshold_n: Forces below this are taken for noise [N].
        rate_hz: Breathing rate, as the ventilator's is known; null: not used [Hz].
        harmonics: How many multiples of it are learnt.
        harmonic_gain_m_per_n_s: Learning gain of each [m/(N s)].
        most_m: Farthest that the estimate may go from the trocar as seen [m].
    """

    type: Literal["interaction_force"] = "interaction_force"
    compliance_m_per_n_s: PositiveFloat = 0.02
    observer_gain: Annotated[float, Field(gt=0.0, le=1.0)] = 0.1
    tare_s: NonNegativeFloat = 0.2
    threshold_n: NonNegativeFloat = 0.0
    rate_hz: PositiveFloat | None = None
    harmonics: Annotated[int, Field(ge=1, le=8)] = 2
    harmonic_gain_m_per_n_s: NonNegativeFloat = 0.016
    most_m: PositiveFloat = 0.03

    def build(self, arm: ArmModel) -> "InteractionForce":
        """The estimator."""
        return InteractionForce(self, arm)


@dataclass(frozen=True, slots=True, kw_only=True)
class InteractionForceMemory:
    """State of the estimator.

    Attributes:
        observer: State of the disturbance observer.
        tare: Mean force so far, or at the end of the tare (3,) [N].
        ticks: Ticks so far.
        offset: Slow part of the estimate's distance from the trocar as seen (3,) [m].
        waves: Cosine and sine amplitude of each harmonic (2 harmonics, 3) [m].
    """

    observer: ObserverState
    tare: Array
    ticks: int
    offset: Array
    waves: Array


class InteractionForce:
    """The port is where the wall leaves the shaft alone.

        f = (J_rcm M^-1 J_rcm^T)^-1 J_rcm M^-1 d,    F = N^T f - tare
        o' = G F,    a_k' = G_h F cos(k w t + pi/4),    b_k' = G_h F sin(k w t + pi/4)
        p_C = p_seen + o + sum_k a_k cos(k w t) + b_k sin(k w t)

    d is the disturbance torque of a momentum observer, f its lateral force at the port in the dynamically
    consistent sense, F the same in the world, with what payload and friction do at the start taken off. With
    a wall of stiffness K and a shaft that follows the estimate, o' = -G K (o - true offset): a first-order
    lag of 1 / (G K), whatever K is. The harmonics are an internal model: they leave no force at their
    frequencies. What o leaves of a wave leads it by 0 degrees (soft wall) to 90 (stiff wall); the advance of
    45 keeps the learning within 45 of the right phase for every K, at the rate k w G_h / (2 G) cos 45 if
    G K > k w. Along the shaft nothing is learnt: there the wall cannot be strained.

    Source: ours; admittance to zero force, and adaptive feed-forward cancellation (Bodson and Douglas 1997).
    """

    def __init__(self, config: InteractionForceConfig, arm: ArmModel) -> None:
        self._c = config
        self._observer = DisturbanceObserver(config.observer_gain, arm.damping)
        count = config.harmonics if config.rate_hz else 0
        self._omega = 2.0 * math.pi * (config.rate_hz or 0.0) * np.arange(1, count + 1)

    def start(self, problem: PortProblem) -> InteractionForceMemory:
        """At the trocar as seen, with no force known."""
        return InteractionForceMemory(
            observer=self._observer.start(),
            tare=np.zeros(3),
            ticks=0,
            offset=np.zeros(3),
            waves=np.zeros((2 * len(self._omega), 3)),
        )

    def step(
        self, problem: PortProblem, memory: InteractionForceMemory
    ) -> tuple[PortEstimate, InteractionForceMemory]:
        """Give way to the force since the last tick."""
        observer = self._observer.update(memory.observer, problem)
        force = self._force(problem, observer.disturbance)
        ticks, tare = memory.ticks + 1, memory.tare
        offset, waves = memory.offset, memory.waves
        phase = self._omega * problem.t_s
        swing = np.concatenate((np.cos(phase), np.sin(phase)))
        learnt = np.concatenate((np.cos(phase + _ADVANCE), np.sin(phase + _ADVANCE)))
        if problem.t_s < self._c.tare_s:
            tare = tare + (force - tare) / ticks
            push = np.zeros(3)
        else:
            push = _beyond(force - tare, self._c.threshold_n)
        last = offset
        offset = _within(last + problem.dt_s * self._c.compliance_m_per_n_s * push, self._c.most_m)
        waves = waves + problem.dt_s * self._c.harmonic_gain_m_per_n_s * np.outer(learnt, push)
        rate = np.concatenate((-self._omega * np.sin(phase), self._omega * np.cos(phase)))
        curve = np.concatenate((self._omega, self._omega)) ** 2 * -swing
        estimate = PortEstimate(
            p_WC=problem.p_WC + offset + swing @ waves,
            v_WC=problem.v_WC + (offset - last) / problem.dt_s + rate @ waves,
            a_WC=curve @ waves,
        )
        return estimate, InteractionForceMemory(
            observer=observer, tare=tare, ticks=ticks, offset=offset, waves=waves
        )

    def _force(self, problem: PortProblem, disturbance: Array) -> Array:
        """Lateral force of the wall on the shaft, world frame (3,) [N]."""
        assert problem.dyn is not None, "a force cannot be inferred on the kinematic plant"
        rcm = rcm_kinematics(problem.kin, problem.p_WC, problem.v_WC)
        return _lateral(rcm.jacobian, rcm.normals, problem.dyn.mass_matrix, disturbance)


@compiled
def _lateral(J: Array, N: Array, M: Array, d: Array) -> Array:
    JMinv = np.ascontiguousarray(np.linalg.solve(M, J.T).T)
    return np.ascontiguousarray(N.T) @ np.linalg.solve(JMinv @ J.T, JMinv @ d)


def _beyond(force: Array, threshold: float) -> Array:
    """`force` shortened by `threshold`, zero below it."""
    size = float(np.linalg.norm(force))
    return force * (1.0 - threshold / size) if size > threshold else np.zeros(3)


def _within(offset: Array, most: float) -> Array:
    """`offset` shortened to `most`."""
    return offset * min(1.0, most / max(float(np.linalg.norm(offset)), 1e-12))
