"""Gradient projection: climb the manipulability in the null space of the task."""

from typing import ClassVar, Literal

import numpy as np
from pydantic import NonNegativeFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.control.manipulability import fill_log_manipulability_gradient
from surgsim.control.resolvers.base import KernelResolver
from surgsim.control.resolvers.rows import answer, fill_task_rows
from surgsim.models.arm import ArmModel
from surgsim.tick.algebra import nearest
from surgsim.tick.arrays import Resolved, Seen
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.status import GOES_ON, RANK_LOST


class GradientConfig(PartConfig):
    """Null-space projection of the manipulability gradient ("Nullspace" in the VPRNN paper).

    Attributes:
        gain_rad2_per_s: k of the null-space velocity k grad(ln mu).
        k_tip: Tip feedback gain [1/s].
        k_rcm: RCM feedback gain [1/s].
        rcm: Whether the RCM rows are stacked below the tip rows.
    """

    shares_null_space: ClassVar[bool] = True
    type: Literal["gradient"] = "gradient"
    gain_rad2_per_s: NonNegativeFloat = 1.0
    k_tip: NonNegativeFloat = 5.0
    k_rcm: NonNegativeFloat = 5.0
    rcm: bool = True

    def build(self, arm: ArmModel) -> KernelResolver:
        """The resolver; gains k_tip, k_rcm, rcm, k."""
        gains = np.array([self.k_tip, self.k_rcm, self.rcm, self.gain_rad2_per_s], dtype=np.float64)
        return KernelResolver(kernel=gradient, arm=arm, gains=gains)


@compiled
def gradient(gains: Array, seen: Seen, memory: Array, out: Resolved) -> int:
    """Climb in the null space, q' = pinv(J) v + (I - pinv(J) J) k grad(ln mu), projected on Omega.

    The gradient is scaled to the velocity limits as a whole before it is projected, so that a large k gives a
    bounded self-motion. Source: Liegeois 1977; the comparison of the VPRNN paper, section IV.
    """
    n, m = seen.q.size, 3 + (seen.rows if gains[2] != 0.0 else 0)
    J, v, climb = scratch_matrix(m, n), scratch(m), scratch(n)
    fill_task_rows(seen, gains[0], gains[1], J, v)
    if not fill_log_manipulability_gradient(seen.Jv_WT, seen.z_W, climb):
        return RANK_LOST
    most = 1.0
    for j in range(climb.size):
        climb[j] *= gains[3]
        most = max(most, abs(climb[j]) / seen.v_max[j])
    for j in range(climb.size):
        climb[j] /= most
    if not nearest(J, v, climb, climb):
        return RANK_LOST
    answer(seen, climb, J, v, out)
    return GOES_ON
