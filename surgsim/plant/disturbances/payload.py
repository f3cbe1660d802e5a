"""Unknown payload on the instrument."""

from typing import Annotated, Literal

import mujoco
import numpy as np
from pydantic import Field

from surgsim.plant.disturbances.base import Disturbance, DisturbanceConfig, Spread, spread_factor


class PayloadConfig(DisturbanceConfig):
    """A point-like mass fixed to the tip adapter that the controller does not know of.

    Attributes:
        mass_kg: Mass of the payload [kg].
        distance_m: Where it sits on the shaft axis, from the flange [m].
        spread: Relative spread of the mass over seeds.
    """

    type: Literal["payload"] = "payload"
    mass_kg: Annotated[float, Field(gt=0.0, le=10.0)] = 0.2
    distance_m: Annotated[float, Field(ge=0.0, le=1.0)] = 0.04
    spread: Spread = 0.0

    def build(self, rng: np.random.Generator) -> "Payload":
        """The disturbance, its mass drawn."""
        return Payload(self, self.mass_kg * float(spread_factor(rng, self.spread)[0]))


class Payload(Disturbance):
    """Adds a solid sphere of water's density as a body fixed to the flange."""

    def __init__(self, config: PayloadConfig, mass_kg: float) -> None:
        self._c = config
        self._mass = mass_kg

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Add the payload's body at the flange."""
        flange = spec.site("flange")
        m = self._mass
        if m <= 0.0:
            return
        name = _free_name(spec)
        radius = (3.0 * m / (4.0 * np.pi * 1000.0)) ** (1.0 / 3.0)
        inertia = 0.4 * m * radius**2
        body = flange.parent.add_body(
            name=name,
            pos=np.array(flange.pos) + np.array([0.0, 0.0, self._c.distance_m]),
            quat=flange.quat,
            mass=m,
            ipos=[0.0, 0.0, 0.0],  # MuJoCo takes the body's own position for a missing one
            inertia=[inertia] * 3,
            explicitinertial=True,
        )
        body.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[radius, 0, 0],
            mass=0.0,
            contype=0,
            conaffinity=0,
            group=2,
            rgba=[0.35, 0.2, 0.55, 1.0],
        )


def _free_name(spec: mujoco.MjSpec) -> str:
    """`payload`, or with a number where there are several."""
    taken = sum(body.name.startswith("payload") for body in spec.bodies)
    return f"payload{taken + 1}" if taken else "payload"
