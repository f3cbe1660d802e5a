"""Unknown payload on the instrument."""

from typing import Annotated, Literal

import mujoco
import numpy as np
from pydantic import Field

from surgsim.catalog import PartConfig
from surgsim.plant.disturbances.base import Disturbance


class PayloadConfig(PartConfig):
    """A point-like mass fixed to the tip adapter that the controller does not know of.

    Attributes:
        mass_kg: Mass of the payload [kg].
        distance_m: Where it sits on the shaft axis, from the flange [m].
    """

    type: Literal["payload"] = "payload"
    mass_kg: Annotated[float, Field(gt=0.0, le=10.0)] = 0.2
    distance_m: Annotated[float, Field(ge=0.0, le=1.0)] = 0.04

    def build(self) -> "Payload":
        """The disturbance."""
        return Payload(self)


class Payload(Disturbance):
    """Adds a solid sphere of water's density as a body fixed to the flange."""

    def __init__(self, config: PayloadConfig) -> None:
        self._c = config

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Add the payload's body at the flange."""
        flange = spec.site("flange")
        m = self._c.mass_kg
        radius = (3.0 * m / (4.0 * np.pi * 1000.0)) ** (1.0 / 3.0)
        inertia = 0.4 * m * radius**2
        body = flange.parent.add_body(
            name="payload",
            pos=np.array(flange.pos) + np.array([0.0, 0.0, self._c.distance_m]),
            quat=flange.quat,
            mass=m,
            inertia=[inertia] * 3,
            explicitinertial=True,
        )
        body.add_geom(
            name="payload",
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[radius, 0, 0],
            mass=0.0,
            contype=0,
            conaffinity=0,
            group=2,
            rgba=[0.35, 0.2, 0.55, 1.0],
        )
