"""Interaction force: a trocar that nobody measures, inferred from what the wall does to the shaft."""

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig, Surroundings
from surgsim.compiled import compiled
from surgsim.control.filters import filter_gains
from surgsim.control.observer import observe_positions, position_observer_size
from surgsim.control.port_estimators.base import KernelPortEstimator
from surgsim.control.port_force import lateral_force
from surgsim.models.arm import ArmModel
from surgsim.tick.algebra import norm
from surgsim.tick.arrays import Seen
from surgsim.tick.scratch import scratch
from surgsim.tick.status import GOES_ON, RANK_LOST

_ADVANCE = 0.25 * math.pi

COMPLIANCE, OBSERVER, TARE_S, THRESHOLD, OMEGA, HARMONICS, LEARNING, MOST, STATE = range(9)
"""Places of the gains; OMEGA in rad/s, the others as in the config."""


class InteractionForceConfig(PartConfig):
    """Lets the estimated trocar give way to the lateral force on the shaft, until there is none.

    Attributes:
        compliance_m_per_n_s: Gain: speed of the estimate per newton [m/(N s)].
        observer_hz: Cut-off of the force estimate [Hz].
        state_hz: Cut-off of the positions and velocities that it is made of [Hz].
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
    observer_hz: PositiveFloat = 5.0
    state_hz: PositiveFloat = 20.0
    tare_s: NonNegativeFloat = 0.2
    threshold_n: NonNegativeFloat = 0.0
    rate_hz: PositiveFloat | None = None
    harmonics: Annotated[int, Field(ge=1, le=8)] = 2
    harmonic_gain_m_per_n_s: NonNegativeFloat = 0.016
    most_m: PositiveFloat = 0.03

    def check(self, scenario: Surroundings) -> None:
        """Refuse a scenario without a wall."""
        if not scenario.has_wall:
            raise ValueError("controller.port 'interaction_force' feels no wall: give trocar.wall")

    def build(self, arm: ArmModel) -> KernelPortEstimator:
        """The estimator; memory tare (3,), offset (3,), ticks, waves (2 harmonics, 3), the observer's."""
        count = self.harmonics if self.rate_hz else 0
        gains = [
            self.compliance_m_per_n_s,
            self.observer_hz,
            self.tare_s,
            self.threshold_n,
            2.0 * math.pi * (self.rate_hz or 0.0),
            count,
            self.harmonic_gain_m_per_n_s,
            self.most_m,
            self.state_hz,
        ]
        return KernelPortEstimator(
            kernel=interaction_force,
            arm=arm,
            gains=np.array(gains, dtype=np.float64),
            memory_size=7 + 6 * count + position_observer_size(arm.limits.torque.size),
        )


@compiled
def interaction_force(gains: Array, seen: Seen, memory: Array, out: Array) -> int:
    """The port is where the wall leaves the shaft alone.

        f = (J_rcm M^-1 J_rcm^T)^-1 J_rcm M^-1 d,    F = N^T f - tare
        o' = G F,    a_k' = G_h F cos(k w t + pi/4),    b_k' = G_h F sin(k w t + pi/4)
        p_C = p_seen + o + sum_k a_k cos(k w t) + b_k sin(k w t)

    d is the disturbance torque that `observe_positions` infers, f its lateral force at the port in the
    dynamically consistent sense, F the same in the world, with what payload and friction do at the start
    taken off. On real drives M holds their motors, though the torques are measured behind them: at the
    accelerations of a breath they are worth 0.05 N m, and no light wrist amplifies the noise.

    With a wall of stiffness K and a shaft that follows the estimate, o' = -G K (o - true offset): a
    first-order lag of 1 / (G K), whatever K is. The harmonics are an internal model: they leave no force at
    their frequencies. What o leaves of a wave leads it by 0 degrees (soft wall) to 90 (stiff wall); the
    advance of 45 keeps the learning within 45 of the right phase for every K, at the rate
    k w G_h / (2 G) cos 45 if G K > k w. Along the shaft nothing is learnt: there the wall cannot be strained.

    Source: ours; admittance to zero force, and adaptive feed-forward cancellation (Bodson and Douglas 1997).
    """
    t, dt, count = seen.t_s, seen.dt_s, int(gains[HARMONICS])
    tare, offset = memory[:3], memory[3:6]
    waves = memory[7 : 7 + 6 * count].reshape((2 * count, 3))
    d = observe_positions(
        memory[7 + 6 * count :],
        seen.first != 0,
        seen.M,
        seen.bias,
        seen.damping,
        seen.q,
        seen.tau,
        filter_gains(gains[STATE], gains[OBSERVER], dt),
        dt,
    )
    force, push = scratch(3), scratch(3)
    push[:] = 0.0
    if not lateral_force(seen, d, force):
        return RANK_LOST
    memory[6] += 1.0
    if t < gains[TARE_S]:
        for i in range(3):
            tare[i] += (force[i] - tare[i]) / memory[6]
    else:
        for i in range(3):
            force[i] -= tare[i]
        size = norm(force)
        if size > gains[THRESHOLD]:
            for i in range(3):
                push[i] = force[i] * (1.0 - gains[THRESHOLD] / size)
    moved = scratch(3)
    for i in range(3):
        moved[i] = offset[i] + dt * gains[COMPLIANCE] * push[i]
    within = min(1.0, gains[MOST] / max(norm(moved), 1e-12))
    for i in range(3):
        moved[i] *= within
        out[0, i] = seen.p_WC[i] + moved[i]
        out[1, i] = seen.v_WC[i] + (moved[i] - offset[i]) / dt
        out[2, i] = 0.0
        offset[i] = moved[i]
    for k in range(count):
        w = (k + 1) * gains[OMEGA]
        c, s = math.cos(w * t), math.sin(w * t)
        learn_c, learn_s = math.cos(w * t + _ADVANCE), math.sin(w * t + _ADVANCE)
        for i in range(3):
            waves[k, i] += dt * gains[LEARNING] * learn_c * push[i]
            waves[count + k, i] += dt * gains[LEARNING] * learn_s * push[i]
            a, b = waves[k, i], waves[count + k, i]
            out[0, i] += c * a + s * b
            out[1, i] += w * (c * b - s * a)
            out[2, i] -= w * w * (c * a + s * b)
    return GOES_ON
