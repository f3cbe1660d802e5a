"""What the arm's measured torque and motion tell: the disturbance torque, and the actuation delay."""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from surgsim.compiled import compiled
from surgsim.models.arm import Dynamics

Array = NDArray[np.float64]


class Observed(Protocol):
    """What is measured at a tick, with the nominal dynamics there."""

    @property
    def dt_s(self) -> float:
        """Control period [s]."""
        ...

    @property
    def v(self) -> Array:
        """Joint velocities (7,) [rad/s]."""
        ...

    @property
    def tau_measured(self) -> Array:
        """Joint torques that acted over the last period (7,) [N m]."""
        ...

    @property
    def dyn(self) -> Dynamics | None:
        """Nominal dynamics; None on the kinematic plant, where there is nothing to observe."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class ObserverState:
    """State of the disturbance observer.

    Attributes:
        disturbance: Estimated disturbance torque d (7,) [N m], in M q'' + bias + D q' = tau + d.
        inertia: M + T D of the last tick (7, 7), None before the first.
        rest: bias + D q' - d of the last tick (7,) [N m].
        v: Measured velocity of the last tick (7,) [rad/s].
    """

    disturbance: Array
    inertia: Array | None = None
    rest: Array | None = None
    v: Array | None = None


class DisturbanceObserver:
    """Attributes unexplained changes of the joint velocities to a disturbance torque.

        v^(k+1) = v(k) + T (M + T D)^-1 (tau + d - bias - D v)
        d      += L (M + T D) (v(k+1) - v^(k+1)) / T

    with tau the torque that was measured over the period. d follows a constant disturbance as a first-order
    lag with the time constant T / L. It is the discrete form of the momentum observer of De Luca et al. 2006,
    for MuJoCo's implicit joint damping.

    Args:
        gain: L, from 0 (off) to 1 (dead beat).
        damping: D (7,) [N m s/rad].
    """

    def __init__(self, gain: float, damping: Array) -> None:
        self._gain = gain
        self._damping = damping

    def start(self) -> ObserverState:
        """Nothing known."""
        return ObserverState(disturbance=np.zeros(7))

    def update(
        self, state: ObserverState, p: Observed, share: float = 1.0, offset: Array | None = None
    ) -> ObserverState:
        """Take in the motion since the last tick.

        Args:
            state: The state so far.
            p: What is measured now.
            share: Share of the gain to be used.
            offset: By how much the measured torque is off (7,) [N m]; taken off it.
        """
        assert p.dyn is not None, "a disturbance torque cannot be seen without dynamics"
        d = state.disturbance
        if state.inertia is not None and state.rest is not None and state.v is not None:
            tau = p.tau_measured if offset is None else p.tau_measured - offset
            d = _corrected(d, state.inertia, state.rest, state.v, p.v, tau, share * self._gain, p.dt_s)
        inertia = p.dyn.mass_matrix + p.dt_s * np.diag(self._damping)
        rest = p.dyn.bias + self._damping * p.v - d
        return ObserverState(disturbance=d, inertia=inertia, rest=rest, v=p.v)


@compiled
def _corrected(
    d: Array, inertia: Array, rest: Array, v_last: Array, v: Array, tau: Array, gain: float, dt: float
) -> Array:
    """D + L ((M + T D) (v - v_last) / T - (tau - rest))."""
    return d + gain * (inertia @ ((v - v_last) / dt) - (tau - rest))


OFFSET_MEMORY_S = 0.05
"""Time constant of the mean difference between measured and commanded torque [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DelayEstimate:
    """By how many periods the measured torque lags behind the commanded one.

    Each candidate delay is scored by a fading sum of its squared mismatch; the best one counts, the shorter
    one where they are equal, as at rest.

    Attributes:
        commands: Torques commanded, newest first (n, 7) [N m]; NaN before the first.
        scores: Fading squared mismatch of each delay 0..n-1 [(N m)^2].
        offset: Slow mean of measured less commanded torque (7,) [N m]: of a drive or sensor that is biased.
        ticks: The estimate.
    """

    commands: Array
    scores: Array
    offset: Array
    ticks: int = 0

    @staticmethod
    def start(most: int) -> "DelayEstimate":
        """No command yet, no delay."""
        return DelayEstimate(
            commands=np.full((most + 1, 7), np.nan), scores=np.zeros(most + 1), offset=np.zeros(7)
        )

    @property
    def in_flight(self) -> Array:
        """Torques commanded and not yet acting, oldest first (ticks, 7) [N m]."""
        return np.ascontiguousarray(self.commands[: self.ticks][::-1])

    def update(self, tau_measured: Array, dt_s: float) -> "DelayEstimate":
        """Compare the torque of the last period with what was commanded 1, 2, ... ticks ago."""
        scores, ticks = _score(self.commands, self.scores, tau_measured)
        offset, expected = self.offset, self.commands[ticks]
        if np.isfinite(self.commands[-1, 0]):  # before, a delay may not have shown
            offset = offset + dt_s / OFFSET_MEMORY_S * (tau_measured - expected - offset)
        return replace(self, scores=scores, ticks=ticks, offset=offset)

    def sent(self, torque: Array) -> "DelayEstimate":
        """Remember the torque (7,) [N m] commanded now."""
        return replace(self, commands=np.concatenate((torque[None], self.commands[:-1])))


@compiled
def _score(commands: Array, scores: Array, measured: Array) -> tuple[Array, int]:
    out = np.empty(scores.size)
    best = 0
    for n in range(scores.size):
        row = n if np.isfinite(commands[n, 0]) else n - 1
        while row > 0 and not np.isfinite(commands[row, 0]):
            row -= 1  # before the first command, the queue held the first one
        mismatch = 0.0
        if np.isfinite(commands[row, 0]):
            for i in range(7):
                mismatch += (measured[i] - commands[row, i]) ** 2
        out[n] = 0.9 * scores[n] + mismatch
        if out[n] < out[best] - 1e-12 - 1e-6 * out[best]:
            best = n
    return out, best
