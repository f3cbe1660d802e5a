"""The controlled stop: brakes the arm and holds it where it came to rest.

IEC 60204-1 knows three stops: category 0 takes the power away, category 1 brakes and then takes it away,
category 2 brakes and holds under power. This is category 2: an arm without brakes that loses its torque
falls, and its instrument is in a patient.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from surgsim.models.arm import ArmModel
from surgsim.plant.state import State
from surgsim.scenario.schema import StopConfig

Array = NDArray[np.float64]
_LEAST_TORQUE_NM = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class StopMotion:
    """What the stop asks of the joints at a tick.

    Attributes:
        q: Positions (7,) [rad].
        qdot: Velocities (7,) [rad/s].
        torque: (7,) [N m].
    """

    q: Array
    qdot: Array
    torque: Array


class StopLaw:
    """Joint impedance about a motion that comes to rest with limited deceleration.

        tau = M(q) (q_s'' + 2 w (q_s' - q') + w^2 (q_s - q)) + bias(q, q'),  w^2 = stiffness

    from the measured state and the nominal model alone. The stopping motion goes on along the joint velocity
    of its first tick, all joints in step: q_s' falls linearly to zero within T = max_i |M q'|_i / (share
    (t_i - |bias_i|)), with the torque limits t; a joint that comes to its position limit stays there.
    """

    def __init__(self, config: StopConfig, arm: ArmModel) -> None:
        self._c = config
        self._arm = arm
        self.release()

    def release(self) -> None:
        """Forget the stop: the next tick begins another."""
        self._begun: State | None = None
        self._length_s = 0.0

    def tick(self, state: State) -> StopMotion:
        """What to do at `state`; the first call after `release` begins the stop."""
        dyn = self._arm.dynamics(state.q, state.v)
        if self._begun is None:
            self._begun = state
            free = np.maximum(self._arm.limits.torque - np.abs(dyn.bias), _LEAST_TORQUE_NM)
            needed = np.abs(dyn.mass_matrix @ state.v) / (self._c.torque_share * free)
            self._length_s = max(float(needed.max()), 1e-9)
        q, v, a = self._motion(state.t_s - self._begun.t_s, self._begun)
        w = np.sqrt(self._c.stiffness_per_s2)
        wanted = a + 2.0 * w * (v - state.v) + w * w * (q - state.q)
        return StopMotion(q=q, qdot=v, torque=dyn.mass_matrix @ wanted + dyn.bias)

    def _motion(self, t: float, begun: State) -> tuple[Array, Array, Array]:
        """Position, velocity and acceleration (7,) of the stopping motion `t` [s] after it began."""
        T, t = self._length_s, min(t, self._length_s)
        left = 1.0 - t / T
        limits = self._arm.limits
        free = begun.q + begun.v * (0.5 * T * (1.0 - left * left))
        q = np.minimum(np.maximum(free, limits.q_min), limits.q_max)
        v = np.where(q == free, begun.v, 0.0)
        return q, v * left, -v / T if left > 0.0 else np.zeros(7)
