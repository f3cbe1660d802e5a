"""Torques in steps: the resolution of the drives."""

from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from surgsim.plant.disturbances.base import QUANTISED, Disturbance, DisturbanceConfig

Array = NDArray[np.float64]


class TorqueQuantisationConfig(DisturbanceConfig):
    """The torque that acts is rounded to whole steps.

    Attributes:
        step_nm: The step, of every joint [N m]. The default is assumed: 12 bits over +-100 N m.
    """

    type: Literal["torque_quantisation"] = "torque_quantisation"
    step_nm: Annotated[float, Field(gt=0.0, le=10.0)] = 0.05

    def build(self, rng: np.random.Generator) -> "TorqueQuantisation":
        """The disturbance."""
        return TorqueQuantisation(self)


class TorqueQuantisation(Disturbance):
    """tau' = s round(tau / s) with the step s."""

    rank = QUANTISED

    def __init__(self, config: TorqueQuantisationConfig) -> None:
        self._step = config.step_nm

    def actuate(self, torque: Array) -> Array:
        """`torque` in whole steps."""
        rounded: Array = self._step * np.rint(torque / self._step)
        return rounded
