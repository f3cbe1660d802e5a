"""Computed torque in joint space on elastic drives: follows the resolver's joint reference."""

from typing import Literal

import numpy as np
from pydantic import PositiveFloat

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.control.elastic_observer import DELAY, ElasticObserverConfig, look_ahead, send
from surgsim.control.torque_laws.base import KernelTorqueLaw
from surgsim.models.arm import ArmModel
from surgsim.tick.algebra import times
from surgsim.tick.arrays import Seen
from surgsim.tick.scratch import scratch
from surgsim.tick.status import GOES_ON

STIFFNESS, DAMPING = range(2)
"""Places of the gains; then the observer's numbers."""
_GAINS = 2
JOINT, BIAS, DISTURBANCE, LIMITS = range(4)
"""Rows of the terms."""


class JointElasticDynamicsConfig(ElasticObserverConfig):
    """Inverse dynamics of the joint reference on elastic drives, with all that `rcm_elastic_dynamics` knows.

    Attributes:
        bandwidth_share: Natural frequency of the joint errors' second-order dynamics, over the lowest
            sqrt(K / B_s) of the drives.
        most_bandwidth_rad_per_s: It is at most this [rad/s].
        damping_ratio: Of the joint errors' dynamics.
    """

    type: Literal["joint_elastic_dynamics"] = "joint_elastic_dynamics"
    bandwidth_share: PositiveFloat = 0.4
    most_bandwidth_rad_per_s: PositiveFloat = 85.0
    damping_ratio: PositiveFloat = 0.7

    def build(self, arm: ArmModel) -> KernelTorqueLaw:
        """The law; its memory is the observer's."""
        numbers = self.numbers(arm)
        w = min(self.bandwidth_share * arm.locked_frequency, self.most_bandwidth_rad_per_s)
        return KernelTorqueLaw(
            kernel=joint_elastic_dynamics,
            arm=arm,
            terms=("joint", "bias", "observer", "limits"),
            gains=np.concatenate([(w * w, 2.0 * self.damping_ratio * w), numbers]),
            memory_size=self.memory_size(arm.limits.torque.size),
        )


@compiled
def joint_elastic_dynamics(gains: Array, seen: Seen, memory: Array, out: Array) -> int:
    """U = (M + B_s) q'' + c + D_l v - d + f, at the state predicted for when the torque will act.

        q'' = w^2 (q_ref - q) + 2 zeta w (q_ref' - v)

    of the joint reference carried on to that instant. What the observer knows, and how the command is kept
    within the arm's limits, is as in `rcm_elastic_dynamics`.

    Rows joint, bias, observer, limits (4, n) [N m].

    Source: computed torque, e.g. Siciliano et al., Robotics (2009), section 8.5.2.
    """
    n, numbers = seen.q.size, gains[_GAINS:]
    d, a, torque, touch = scratch(n), scratch(n), scratch(n), scratch(n)
    touch[:] = 0.0
    status = look_ahead(numbers, seen, memory, touch, d)
    if status != GOES_ON:
        return status
    model, late = seen.elsewhere, numbers[DELAY] * seen.dt_s
    for i in range(n):
        gap = seen.q_ref[i] + late * seen.qdot_ref[i] - model.q[i]
        a[i] = gains[STIFFNESS] * gap + gains[DAMPING] * (seen.qdot_ref[i] - model.v[i])
    times(model.M, a, torque)
    for i in range(n):
        out[JOINT, i] = torque[i]
        out[BIAS, i] = model.bias[i] + seen.damping[i] * model.v[i]
        out[DISTURBANCE, i], out[LIMITS, i] = -d[i], 0.0
    send(numbers, seen, memory, out, LIMITS)
    return GOES_ON
