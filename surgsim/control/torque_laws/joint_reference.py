"""The joint reference for the arm's own impedance loop, and a torque beside it."""

from typing import ClassVar, Literal

import numpy as np

from surgsim.array import Array
from surgsim.catalog import PartConfig, Surroundings
from surgsim.compiled import compiled
from surgsim.control.torque_laws.base import KernelTorqueLaw
from surgsim.models.arm import ArmModel
from surgsim.tick.arrays import Seen
from surgsim.tick.status import GOES_ON


class JointReferenceConfig(PartConfig):
    """Commands the resolver's joint reference to the arm's own impedance loop (`robot.drive.command`).

    Attributes:
        commands_reference: True: its torque is added to that of the loop.
        feedforward: The torque beside the reference: `damping` is what the loop's damping takes of the
            reference's velocity, without which the arm lags; `none`: positions alone.

    Example:
        >>> JointReferenceConfig().feedforward
        'damping'
    """

    commands_reference: ClassVar[bool] = True
    type: Literal["joint_reference"] = "joint_reference"
    feedforward: Literal["none", "damping"] = "damping"

    def check(self, scenario: Surroundings) -> None:
        """Refuse an arm that takes torques."""
        if not scenario.takes_joint_reference:
            raise ValueError(
                "joint_reference needs robot.drive.command joint_impedance: the arm takes torques"
            )

    def build(self, arm: ArmModel) -> KernelTorqueLaw:
        """The law; gains K_j (n,) and 2 zeta (n,), zeros without loop or feed-forward."""
        n = arm.limits.q_min.size
        gains, own = np.zeros(2 * n), None if arm.drive is None else arm.drive.impedance
        if own is not None and self.feedforward == "damping":
            gains[:n], gains[n:] = own.stiffness, 2.0 * own.damping_ratio
        return KernelTorqueLaw(
            kernel=joint_reference,
            arm=arm,
            terms=("feedforward",),
            gains=gains,
            commands_reference=self.commands_reference,
        )


@compiled
def joint_reference(gains: Array, seen: Seen, memory: Array, out: Array) -> int:
    """Tau_ff = D_j q_ref', D_j = 2 zeta sqrt(K_j M_jj); row feedforward (1, n) [N m].

    The loop's damping acts on the joints' velocities, not on their deviation from those of the reference:
    K_j (q_ref - q) = D_j q' while the arm moves evenly, unless that torque is commanded too. What
    acceleration takes is not in it. M is that of the nominal model, as in the loop itself
    (`surgsim.plant.impedance`).
    """
    n = seen.q.size
    for j in range(n):
        out[0, j] = gains[n + j] * np.sqrt(gains[j] * seen.M[j, j]) * seen.qdot_ref[j]
    return GOES_ON
