"""Operational-space law with projected Jacobians: RCM, tip below it, posture below both."""

from typing import Literal

import numpy as np

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.control.torque_laws.base import KernelTorqueLaw
from surgsim.control.torque_laws.decoupled import task_torque
from surgsim.control.torque_laws.hierarchical_impedance import project_torque
from surgsim.control.torque_laws.rcm_tasks import OWN_GAINS, RcmTasksConfig, wanted
from surgsim.models.arm import ArmModel
from surgsim.tick.algebra import back_substitute_rows, dot, factor, times
from surgsim.tick.arrays import Seen
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.status import GOES_ON, RANK_LOST

DYNAMIC = OWN_GAINS
"""Place of the gain that is this law's own: whether projectors are dynamically consistent."""
RCM, TIP, JOINT, BIAS = range(4)
"""Rows of the terms."""


class ProjectedJacobianConfig(RcmTasksConfig):
    """Forces at RCM and tip through Jacobians that are projected into the null space of those above.

    Attributes:
        inverse: Of the projectors: `plain`, the pseudo-inverse, or `dynamic`, the inertia-weighted one.
    """

    type: Literal["projected_jacobian"] = "projected_jacobian"
    inverse: Literal["plain", "dynamic"] = "plain"

    def build(self, arm: ArmModel) -> KernelTorqueLaw:
        """The law, without memory."""
        gains = [*self.task_gains(), float(self.inverse == "dynamic")]
        return KernelTorqueLaw(
            kernel=projected_jacobian, arm=arm, terms=("rcm", "tip", "joint", "bias"), gains=np.array(gains)
        )


@compiled
def projected_jacobian(gains: Array, seen: Seen, memory: Array, out: Array) -> int:
    """Tau = A^T F_r + N_1 J^T F_t + N_2 M q''_0 + h; rows rcm, tip, joint, bias (4, n) [N m].

        F_r = (A M^-1 A^T)^-1 c,       F_t = Lambda (a - J M^-1 A^T F_r)
        plain:   N_i = I - J_i^+ J_i,  Lambda = (J M^-1 J^T)^-1
        dynamic: N_i = I - J_i^T (J_i M^-1 J_i^T)^-1 J_i M^-1,  Lambda = (J M^-1 N_1 J^T)^-1
        with J_1 = A and J_2 = [J; A]

    A, J, c, a, q''_0 and h are those of `wanted`. What the RCM's force does to the tip is allowed for. With
    `dynamic` nothing below accelerates what is above, and the tip is met: the law is strict. With `plain`
    N_1 J^T F_t accelerates the RCM, and N_2 M q''_0 both, since A M^-1 P is not zero. There J M^-1 N_1 J^T is
    not positive definite, and the loop is unstable with its inverse for Lambda; hence the other one.

    Source: Khatib (1987), with the projectors that Dietrich, Ott and Albu-Schaeffer, "An overview of null
    space projections for redundant, torque-controlled robots" (2015), call statically and dynamically
    consistent.
    """
    n, r = seen.q.size, seen.rows
    J, a, posture = scratch_matrix(3 + r, n), scratch(3 + r), scratch(n)
    wanted(gains, seen, J, a, posture, out[BIAS])
    moved, L = scratch_matrix(3 + r, n), scratch_matrix(n, n)
    L[:], moved[:] = seen.M, J
    if not factor(L):
        return RANK_LOST
    back_substitute_rows(L, moved)
    if not task_torque(J[3:], moved[3:], a[3:], out[RCM]):
        return RANK_LOST
    dynamic = gains[DYNAMIC] != 0.0
    weighted, below, reached = scratch_matrix(3 + r, n), scratch_matrix(3, n), scratch(3)
    weighted[:], below[:] = moved if dynamic else J, J[:3]
    for i in range(3):
        reached[i] = a[i] - dot(moved[i], out[RCM])
        if dynamic and r > 0 and not project_torque(J[3:], moved[3:], below[i]):
            return RANK_LOST
    if not task_torque(below, moved[:3], reached, out[TIP]):
        return RANK_LOST
    if r > 0 and not project_torque(J[3:], weighted[3:], out[TIP]):
        return RANK_LOST
    times(seen.M, posture, out[JOINT])
    return GOES_ON if project_torque(J, weighted, out[JOINT]) else RANK_LOST
