"""The trocar as it is seen: no estimation."""

from typing import Literal

import numpy as np

from surgsim.catalog import PartConfig
from surgsim.control.port_estimators.base import PortEstimate, PortProblem
from surgsim.models.arm import ArmModel

_STILL = np.zeros(3)
_STILL.flags.writeable = False


class MeasuredPortConfig(PartConfig):
    """Takes position as seen and velocity as announced."""

    type: Literal["measured"] = "measured"

    def build(self, arm: ArmModel) -> "MeasuredPort":
        """The estimator."""
        return MeasuredPort()


class MeasuredPort:
    """p_WC and v_WC of the state, no acceleration."""

    def start(self, problem: PortProblem) -> None:
        """It has no state."""

    def step(self, problem: PortProblem, memory: None) -> tuple[PortEstimate, None]:
        """The trocar as seen."""
        return PortEstimate(p_WC=problem.p_WC, v_WC=problem.v_WC, a_WC=_STILL), None
