"""Pseudo-inverse: the least joint velocity that moves the tip as asked."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import NonNegativeFloat

from surgsim.catalog import PartConfig
from surgsim.control.null_space import least_velocity
from surgsim.control.problem import (
    Resolution,
    VelocityProblem,
    bounded_resolution,
    stacked_rows,
)
from surgsim.models.arm import ArmModel

Array = NDArray[np.float64]


class PinvConfig(PartConfig):
    """Pseudo-inverse of the tip Jacobian, with or without the RCM rows.

    Attributes:
        k_tip: Tip feedback gain [1/s]; 0 is the open-loop scheme of the manipulability paper.
        k_rcm: RCM feedback gain [1/s].
        rcm: Whether the RCM rows are stacked below the tip rows.
    """

    type: Literal["pinv"] = "pinv"
    k_tip: NonNegativeFloat = 5.0
    k_rcm: NonNegativeFloat = 5.0
    rcm: bool = True

    def build(self, arm: ArmModel) -> "Pinv":
        """The resolver."""
        return Pinv(self)


class Pinv:
    """q' = pinv(J) v, eq. (2)-(5) of the manipulability paper, projected on Omega.

    J = J_T (3, 7), or [J_T; J_rcm] (5, 7); v is the desired velocity with feedback, see `stacked_rows`.
    """

    def __init__(self, config: PinvConfig) -> None:
        self._c = config

    def start(self, problem: VelocityProblem) -> None:
        """The resolver has no state."""

    def step(self, problem: VelocityProblem, memory: None) -> tuple[Resolution, None]:
        """Joint velocities for one period."""
        J, v = stacked_rows(problem, self._c.k_tip, self._c.k_rcm, rcm=self._c.rcm)
        return bounded_resolution(problem, least_velocity(J, v), J, v), None
