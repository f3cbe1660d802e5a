"""What torque laws are asked for at a trocar: accelerations of RCM, tip and posture, and their gains."""

from pydantic import NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.control.torque_laws.rcm_hierarchy import HIERARCHY_GAINS, Pair, fill_demand, hierarchy_gains
from surgsim.tick.arrays import Seen
from surgsim.tick.nominal import copy_model

OWN_GAINS = HIERARCHY_GAINS
"""Place of the first gain that is a law's own."""


class RcmTasksConfig(PartConfig):
    """Second-order dynamics of the errors of RCM, tip and posture.

    Attributes:
        rcm_stiffness_per_s2: Proportional gain of the RCM error, per unit mass [1/s^2].
        rcm_damping_ratio: Damping of the RCM error's dynamics.
        tip_stiffness_per_s2: Proportional gain of the tip error [1/s^2].
        tip_damping_ratio: Damping of the tip error's dynamics.
        joint_stiffness_per_s2: Gain about the joint reference in the remaining null space [1/s^2].
        joint_damping_ratio: Damping there.
    """

    rcm_stiffness_per_s2: PositiveFloat = 2e4
    rcm_damping_ratio: PositiveFloat = 1.0
    tip_stiffness_per_s2: PositiveFloat = 1e4
    tip_damping_ratio: PositiveFloat = 1.0
    joint_stiffness_per_s2: NonNegativeFloat = 100.0
    joint_damping_ratio: NonNegativeFloat = 1.0

    def task_gains(self, *further: float) -> list[float]:
        """Gains (OWN_GAINS,) of the tasks, then those of `hierarchy_gains` that are not the tasks'."""
        return hierarchy_gains(
            (self.rcm_stiffness_per_s2, self.rcm_damping_ratio),
            (self.tip_stiffness_per_s2, self.tip_damping_ratio),
            (self.joint_stiffness_per_s2, self.joint_damping_ratio),
            *further,
        )

    def bounded_gains(self, most_rad_per_s: float, damping_ratio: float) -> list[float]:
        """The same for bandwidths of at most `most_rad_per_s`; there RCM and tip have `damping_ratio`."""
        most = most_rad_per_s * most_rad_per_s

        def pair(stiffness: float, ratio: float, bounded: float) -> Pair:
            return (most, bounded) if stiffness > most else (stiffness, ratio)

        return hierarchy_gains(
            pair(self.rcm_stiffness_per_s2, self.rcm_damping_ratio, damping_ratio),
            pair(self.tip_stiffness_per_s2, self.tip_damping_ratio, damping_ratio),
            pair(self.joint_stiffness_per_s2, self.joint_damping_ratio, self.joint_damping_ratio),
        )


@compiled
def wanted(gains: Array, seen: Seen, J: Array, a: Array, posture: Array, h: Array) -> None:
    """Fill rows and accelerations that are asked for now, and the torque h that no acceleration needs.

        tip:     J_T q''   = a_d - J_T' q' + d_t (v_d - v) + k_t (p_d - p)
        RCM:     J_rcm q'' = N C'' - b_rcm - k_r e_N - d_r e_N'
        posture: q''       = k_q (q_ref - q) + d_q (q_ref' - q')
        h        = bias + D q'

    Args:
        gains: That begin with `RcmTasksConfig.task_gains`.
        seen: State, command and trocar.
        J: Filled: tip rows, then RCM rows (3 or 5, n).
        a: Filled: their accelerations (3 or 5,) [m/s^2].
        posture: Filled: the posture's acceleration (n,) [rad/s^2].
        h: Filled: Coriolis, centrifugal and gravity torque of the nominal model, and its joint damping
            (n,) [N m].
    """
    model = seen.elsewhere
    copy_model(seen, model)
    fill_demand(gains, seen, model, 0.0, 1.0, J, a, posture)
    fill_bias(seen, h)


@compiled
def fill_bias(seen: Seen, h: Array) -> None:
    """Fill the torque that no acceleration needs (n,) [N m]: bias of the nominal model, and joint damping."""
    for i in range(h.size):
        h[i] = seen.bias[i] + seen.damping[i] * seen.v[i]
