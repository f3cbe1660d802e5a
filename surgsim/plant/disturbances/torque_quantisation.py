"""Torques in steps: the resolution of the drives."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.plant.disturbances.base import QUANTISED, Disturbance, DisturbanceConfig
from surgsim.tick.arrays import World
from surgsim.tick.status import GOES_ON


@compiled
def quantise(gains: Array, world: World, memory: Array, out: Array) -> int:
    """What acts: tau' = s round(tau / s) with the step s."""
    step = gains[0]
    for i in range(world.torque.size):
        world.torque[i] = step * np.rint(world.torque[i] / step)
    return GOES_ON


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
    """Drives that know whole steps alone."""

    rank = QUANTISED
    kernels: Mapping[str, Any] = {"actuate": quantise}

    def __init__(self, config: TorqueQuantisationConfig) -> None:
        self.gains = np.array([config.step_nm])
