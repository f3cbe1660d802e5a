"""RCM inverse dynamics on elastic drives: RCM over tip over posture, links and motors observed apart."""

from typing import Annotated, Literal

import numpy as np
from pydantic import NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.catalog import ADDED
from surgsim.compiled import compiled
from surgsim.control.elastic_observer import DELAY, ElasticObserverConfig, look_ahead, send
from surgsim.control.torque_laws.base import KernelTorqueLaw
from surgsim.control.torque_laws.rcm_hierarchy import (
    HIERARCHY_GAINS,
    LIMITS,
    TERMS,
    fill_terms,
    fill_touch,
    hierarchy_gains,
)
from surgsim.models.arm import ArmModel
from surgsim.tick.arrays import Seen
from surgsim.tick.scratch import scratch
from surgsim.tick.status import GOES_ON, INFEASIBLE


class RcmElasticDynamicsConfig(ElasticObserverConfig):
    """Inverse dynamics of RCM, tip and posture in strict priority, for arms with elastic drives.

    Attributes:
        bandwidth_share: Natural frequency of the RCM error's second-order dynamics, over the lowest
            sqrt(K / B_s) of the drives.
        most_bandwidth_rad_per_s: It is at most this [rad/s].
        tip_bandwidth_ratio: The tip's bandwidth over the RCM's.
        joint_bandwidth_rad_per_s: About the joint reference in the remaining null space [rad/s].
        damping_ratio: Of RCM and tip.
        contact: What becomes of the measured force on the tip, as of `rcm_inverse_dynamics`: `reject` or
            `yield`.
    """

    type: Literal["rcm_elastic_dynamics"] = "rcm_elastic_dynamics"
    bandwidth_share: PositiveFloat = 0.4
    most_bandwidth_rad_per_s: PositiveFloat = 85.0
    tip_bandwidth_ratio: PositiveFloat = 1.0
    joint_bandwidth_rad_per_s: NonNegativeFloat = 10.0
    damping_ratio: PositiveFloat = 0.7
    contact: Annotated[Literal["reject", "yield"], ADDED] = "reject"

    def build(self, arm: ArmModel) -> KernelTorqueLaw:
        """The law; its memory is the observer's."""
        numbers = self.numbers(arm)
        rcm = min(self.bandwidth_share * arm.locked_frequency, self.most_bandwidth_rad_per_s)
        tip, joint, ratio = self.tip_bandwidth_ratio * rcm, self.joint_bandwidth_rad_per_s, self.damping_ratio
        return KernelTorqueLaw(
            kernel=rcm_elastic_dynamics,
            arm=arm,
            terms=TERMS,
            gains=np.concatenate(
                [
                    hierarchy_gains(
                        (rcm**2, ratio),
                        (tip**2, ratio),
                        (joint**2, 1.0),
                        0.0,
                        self.contact == "yield",
                    ),
                    numbers,
                ]
            ),
            memory_size=self.memory_size(arm.limits.torque.size),
            failures={INFEASIBLE: "no joint acceleration keeps all limits"},
        )


@compiled
def rcm_elastic_dynamics(gains: Array, seen: Seen, memory: Array, out: Array) -> int:
    """U = (M + B_s) q'' + c + D_l v - d + f, at the state predicted for when the torque will act.

    `surgsim.control.elastic_observer` gives that state, d and f; the accelerations are those of the hierarchy
    of `rcm_inverse_dynamics`, weighted with M + B_s: what a torque behind the torque loop moves below its
    bandwidth. The command changes no faster than the arm's interface takes. With `contact: yield` the torque
    J_T' f of the measured force on the tip is part of d from the first tick, and the observer is left the
    rest; the tip gives way along f as with `rcm_inverse_dynamics`.

    Rows tip, rcm, joint, bias, observer, limits (6, n) [N m].

    Source: ours; that links and motors move as one below the drives' bandwidth is the slow part of singular
    perturbation, Spong, Khorasani and Kokotovic, IEEE J. Robotics and Automation 3:294 (1987).
    """
    numbers, d, touch = gains[HIERARCHY_GAINS:], scratch(seen.q.size), scratch(seen.q.size)
    fill_touch(gains, seen, touch)
    status = look_ahead(numbers, seen, memory, touch, d)
    if status != GOES_ON:
        return status
    status = fill_terms(gains, seen, seen.elsewhere, numbers[DELAY] * seen.dt_s, d, 1.0, out)
    if status == GOES_ON:
        send(numbers, seen, memory, out, LIMITS)
    return status
