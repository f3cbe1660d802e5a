"""A trocar that is not where the controller believes it to be."""

from collections.abc import Mapping
from typing import Any, Literal

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.models.config import Vec3
from surgsim.plant.disturbances.base import (
    Direction,
    Disturbance,
    DisturbanceConfig,
    Spread,
    pointed,
    spread_factor,
)
from surgsim.plant.disturbances.breathing import refuse_without_port
from surgsim.tick.arrays import World
from surgsim.tick.status import GOES_ON


@compiled
def misplace(gains: Array, world: World, memory: Array, out: Array) -> int:
    """The trocar where it is believed to be: p + e, with the error e as gains."""
    for i in range(3):
        world.p_WC_m[i] += gains[i]
    return GOES_ON


class TrocarCalibrationConfig(DisturbanceConfig):
    """A constant error of the trocar's position as the controller knows it.

    Attributes:
        error_m: Position known minus true position, world frame [m]. The default is assumed.
        direction: `given` as in error_m, or `random`: the same size, a direction drawn from the sphere.
        spread: Relative spread of the size over seeds.
    """

    type: Literal["trocar_calibration"] = "trocar_calibration"
    error_m: Vec3 = (0.001, 0.0, 0.0)
    direction: Direction = "given"
    spread: Spread = 0.0

    def build(self, rng: np.random.Generator) -> "TrocarCalibration":
        """The disturbance, size and direction drawn."""
        error = pointed(rng, np.array(self.error_m), self.direction)
        return TrocarCalibration(error * spread_factor(rng, self.spread))


class TrocarCalibration(Disturbance):
    """Adds the error (3,) [m] to the trocar's measured position, whether it is tracked or only known."""

    kernels: Mapping[str, Any] = {"sense": misplace}

    def __init__(self, error: Array) -> None:
        self.gains = error

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Refuse a scenario without a trocar."""
        refuse_without_port(spec, "trocar_calibration")
