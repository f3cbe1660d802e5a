"""Joint torques that are off by a constant."""

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from pydantic import NonNegativeFloat

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.models.build import Scene
from surgsim.plant.disturbances.base import (
    BIASED,
    Disturbance,
    DisturbanceConfig,
    Spread,
    copied,
    spread_factor,
)
from surgsim.tick.arrays import World
from surgsim.tick.status import GOES_ON


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
        """The disturbance, which draws each joint's bias."""
        return TorqueBias(self, rng)


class TorqueBias(Disturbance):
    """Adds one bias (n,) [N m] to the torque that acts and another to the one measured."""

    rank = BIASED
    kernels: Mapping[str, Any] = {"actuate": bias_drive, "sense": bias_sensor}

    def __init__(self, config: TorqueBiasConfig, rng: np.random.Generator) -> None:
        self._c = config
        self._rng = rng

    def attach(self, scene: Scene, dt_s: float) -> None:
        """Draw each joint's bias."""
        c, rng, n = self._c, copied(self._rng), scene.dof_ids.size
        bias = c.bias_nm * spread_factor(rng, c.spread, n)
        if c.signs == "random":
            bias *= rng.choice([-1.0, 1.0], n)
        acting = {"sensor": 0.0, "drive": 1.0, "loop": -1.0}[c.of] * bias
        measured = {"sensor": 1.0, "drive": 0.0, "loop": 1.0}[c.of] * bias
        self.gains = np.concatenate((acting, measured))
