"""Joint torques that are off by a constant."""

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import NonNegativeFloat

from surgsim.compiled import compiled
from surgsim.plant.disturbances.base import BIASED, Disturbance, DisturbanceConfig, Spread, spread_factor
from surgsim.tick.arrays import World
from surgsim.tick.status import GOES_ON

Array = NDArray[np.float64]


@compiled
def bias_drive(gains: Array, world: World, memory: Array, out: Array) -> int:
    """What acts: tau + b_a, with the first n gains b_a."""
    for i in range(world.torque.size):
        world.torque[i] += gains[i]
    return GOES_ON


@compiled
def bias_sensor(gains: Array, world: World, memory: Array, out: Array) -> int:
    """What is measured of what acted: tau + b_m, with the last n gains b_m."""
    n = world.tau_m.size
    for i in range(n):
        world.tau_m[i] += gains[n + i]
    return GOES_ON


class TorqueBiasConfig(DisturbanceConfig):
    """A constant bias of every joint's torque: as it acts, as it is measured, or both.

    Attributes:
        bias_nm: Size of the bias b [N m]. The default is assumed.
        of: `sensor`: tau acts and tau + b is measured; `drive`: tau + b acts and is measured; `loop`: a
            torque loop closed on a sensor with the bias b, so that tau - b acts and tau is measured.
        signs: `given`: b > 0 in all joints; `random`: the sign of each joint is drawn.
        spread: Relative spread over seeds, drawn for each joint.
    """

    type: Literal["torque_bias"] = "torque_bias"
    bias_nm: NonNegativeFloat = 0.3
    of: Literal["sensor", "drive", "loop"] = "loop"
    signs: Literal["given", "random"] = "given"
    spread: Spread = 0.0

    def build(self, rng: np.random.Generator) -> "TorqueBias":
        """The disturbance, each joint's bias drawn."""
        bias = self.bias_nm * spread_factor(rng, self.spread, 7)
        if self.signs == "random":
            bias *= rng.choice([-1.0, 1.0], 7)
        return TorqueBias(bias, of=self.of)


class TorqueBias(Disturbance):
    """Adds one bias (7,) [N m] to the torque that acts and another to the one measured."""

    rank = BIASED
    kernels: Mapping[str, Any] = {"actuate": bias_drive, "sense": bias_sensor}

    def __init__(self, bias: Array, *, of: Literal["sensor", "drive", "loop"]) -> None:
        acting = {"sensor": 0.0, "drive": 1.0, "loop": -1.0}[of] * bias
        measured = {"sensor": 1.0, "drive": 0.0, "loop": 1.0}[of] * bias
        self.gains = np.concatenate((acting, measured))
