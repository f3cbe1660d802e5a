"""Accelerations resolved in a basis of the RCM constraint's null space, without weights; inverse dynamics."""

from typing import Literal

import numpy as np

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.control.torque_laws.base import KernelTorqueLaw
from surgsim.control.torque_laws.rcm_tasks import RcmTasksConfig, wanted
from surgsim.models.arm import ArmModel
from surgsim.tick.algebra import nearest, times
from surgsim.tick.arrays import Seen
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.status import GOES_ON, RANK_LOST


class NullSpaceBasisConfig(RcmTasksConfig):
    """Inverse dynamics of accelerations that are resolved in a basis of the constraint's null space."""

    type: Literal["null_space_basis"] = "null_space_basis"

    def build(self, arm: ArmModel) -> KernelTorqueLaw:
        """The law, without memory."""
        return KernelTorqueLaw(
            kernel=null_space_basis, arm=arm, terms=("motion", "bias"), gains=np.array(self.task_gains())
        )


@compiled
def null_space_basis(gains: Array, seen: Seen, memory: Array, out: Array) -> int:
    """Tau = M q'' + h, q'' = A^+ c + Z nu'; rows motion, bias (2, n) [N m].

        nu' = (J Z)^+ (a - J A^+ c) + (I - (J Z)^+ J Z) Z^T q''_0

    with the columns of Z an orthonormal basis of A's null space, and A, J, c, a, q''_0, h those of `wanted`.
    This q'' is the one nearest to q''_0 that gives both rows, in the plain norm of joint accelerations, by
    which it is computed: no Z is needed. RCM and tip move as in `constraint_consistent`, the posture does
    not: there the norm is that of the inertia.

    Source: the form q' = J_N^+ (..) + Z (J Z)^+ (..) of the RCM literature, at acceleration level; the
    inverse dynamics are the computed torque of Luh, Walker and Paul (1980).
    """
    n, m = seen.q.size, 3 + seen.rows
    J, a, posture = scratch_matrix(m, n), scratch(m), scratch(n)
    wanted(gains, seen, J, a, posture, out[1])
    if not nearest(J, a, posture, posture):
        return RANK_LOST
    times(seen.M, posture, out[0])
    return GOES_ON
