"""Gradient projection: climb the manipulability in the null space of the task."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import NonNegativeFloat

from surgsim.catalog import PartConfig
from surgsim.control.manipulability import log_manipulability_gradient
from surgsim.control.null_space import least_velocity
from surgsim.control.problem import Resolution, VelocityProblem, bounded_resolution, stacked_rows
from surgsim.models.arm import ArmModel

Array = NDArray[np.float64]


class GradientConfig(PartConfig):
    """Null-space projection of the manipulability gradient ("Nullspace" in the VPRNN paper).

    Attributes:
        gain_rad2_per_s: k of the null-space velocity k grad(ln mu).
        k_tip: Tip feedback gain [1/s].
        k_rcm: RCM feedback gain [1/s].
        rcm: Whether the RCM rows are stacked below the tip rows.
    """

    type: Literal["gradient"] = "gradient"
    gain_rad2_per_s: NonNegativeFloat = 1.0
    k_tip: NonNegativeFloat = 5.0
    k_rcm: NonNegativeFloat = 5.0
    rcm: bool = True

    def build(self, arm: ArmModel) -> "Gradient":
        """The resolver."""
        return Gradient(self)


class Gradient:
    """q' = pinv(J) v + (I - pinv(J) J) k grad(ln mu), projected on Omega.

    The gradient is scaled to the velocity limits as a whole before it is projected, so that a large k gives a
    bounded self-motion. Source: Liegeois 1977; the comparison of the VPRNN paper, section IV.
    """

    def __init__(self, config: GradientConfig) -> None:
        self._c = config

    def start(self, problem: VelocityProblem) -> None:
        """The resolver has no state."""

    def step(self, problem: VelocityProblem, memory: None) -> tuple[Resolution, None]:
        """Joint velocities for one period."""
        J, v = stacked_rows(problem, self._c.k_tip, self._c.k_rcm, rcm=self._c.rcm)
        climb = self._c.gain_rad2_per_s * log_manipulability_gradient(problem.kin.Jv_WT, problem.kin.z_W)
        climb = climb / max(1.0, float(np.max(np.abs(climb) / problem.limits.velocity)))
        return bounded_resolution(problem, least_velocity(J, v, climb), J, v), None
