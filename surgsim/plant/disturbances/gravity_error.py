"""Gravity that is not what the controller's model says: the arm's base is not level."""

import math
from typing import Annotated, Literal

import mujoco
import numpy as np
from pydantic import Field, FiniteFloat

from surgsim.array import Array
from surgsim.plant.disturbances.base import Direction, Disturbance, DisturbanceConfig, Spread, spread_factor
from surgsim.spatial import cross


class GravityErrorConfig(DisturbanceConfig):
    """The plant's gravity leans and is scaled against the model's.

    Attributes:
        tilt_rad: Angle between the two [rad]. The default, half a degree, is assumed.
        heading_rad: Towards which it leans, from the world's x axis about the vertical [rad].
        scale: Size of the plant's gravity over the model's.
        direction: `given`: heading_rad; `random`: the heading is drawn.
        spread: Relative spread over seeds of the tilt and of the scale's error, scale - 1.
    """

    type: Literal["gravity_error"] = "gravity_error"
    tilt_rad: Annotated[float, Field(ge=0.0, le=0.8)] = 0.01
    heading_rad: FiniteFloat = 0.0
    scale: Annotated[float, Field(gt=0.1, le=5.0)] = 1.0
    direction: Direction = "given"
    spread: Spread = 0.0

    def build(self, rng: np.random.Generator) -> "GravityError":
        """The disturbance, tilt, scale and heading drawn."""
        tilt, scale = spread_factor(rng, self.spread, 2)
        heading = rng.uniform(-math.pi, math.pi) if self.direction == "random" else self.heading_rad
        return GravityError(self.tilt_rad * tilt, heading, 1.0 + (self.scale - 1.0) * scale)


class GravityError(Disturbance):
    """g' = k R g, turned and scaled.

    R turns by the tilt about the horizontal axis (sin a, -cos a, 0), with the heading a; k is the scale.

    Level gravity (0, 0, -g) becomes k g (sin(tilt) cos a, sin(tilt) sin a, -cos(tilt)).
    """

    def __init__(self, tilt_rad: float, heading_rad: float, scale: float) -> None:
        self._axis = np.array([math.sin(heading_rad), -math.cos(heading_rad), 0.0])
        self._tilt, self._scale = tilt_rad, scale

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Turn and scale gravity; a second such error acts on the first one's."""
        spec.option.gravity = self._scale * _turned(np.array(spec.option.gravity), self._axis, self._tilt)


def _turned(a: Array, axis: Array, angle: float) -> Array:
    """`a` turned about the unit vector `axis` (Rodrigues' formula)."""
    c, s = math.cos(angle), math.sin(angle)
    return c * a + s * cross(axis, a) + (1.0 - c) * (axis @ a) * axis
