"""Pseudo-inverse: the least joint velocity that moves the tip as asked."""

from typing import ClassVar, Literal

import numpy as np
from pydantic import NonNegativeFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.control.resolvers.base import KernelResolver
from surgsim.control.resolvers.rows import answer, fill_task_rows
from surgsim.models.arm import ArmModel
from surgsim.tick.algebra import nearest
from surgsim.tick.arrays import Resolved, Seen
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.status import GOES_ON, RANK_LOST


class PinvConfig(PartConfig):
    """Pseudo-inverse of the tip Jacobian, with or without the RCM rows.

    Attributes:
        k_tip: Tip feedback gain [1/s]; 0 is the open-loop scheme of the manipulability paper.
        k_rcm: RCM feedback gain [1/s].
        rcm: Whether the RCM rows are stacked below the tip rows.
    """

    shares_null_space: ClassVar[bool] = True
    type: Literal["pinv"] = "pinv"
    k_tip: NonNegativeFloat = 5.0
    k_rcm: NonNegativeFloat = 5.0
    rcm: bool = True

    def build(self, arm: ArmModel) -> KernelResolver:
        """The resolver; gains k_tip, k_rcm, rcm."""
        gains = np.array([self.k_tip, self.k_rcm, self.rcm], dtype=np.float64)
        return KernelResolver(kernel=pinv, arm=arm, gains=gains)


@compiled
def pinv(gains: Array, seen: Seen, memory: Array, out: Resolved) -> int:
    """The least joint velocity that moves the tip as asked, projected on Omega.

        q' = pinv(J) v,    eq. (2)-(5) of the manipulability paper

    J = J_T (3, n), or [J_T; J_rcm] (5, n); v is the desired velocity with feedback, see `fill_task_rows`.
    """
    n, m = seen.q.size, 3 + (seen.rows if gains[2] != 0.0 else 0)
    J, v, qdot = scratch_matrix(m, n), scratch(m), scratch(n)
    fill_task_rows(seen, gains[0], gains[1], J, v)
    qdot[:] = 0.0
    if not nearest(J, v, qdot, qdot):
        return RANK_LOST
    answer(seen, qdot, J, v, out)
    return GOES_ON
