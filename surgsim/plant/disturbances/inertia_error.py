"""Links that are heavier than the controller's model says."""

from typing import Annotated, Literal

import mujoco
import numpy as np
from pydantic import Field

from surgsim.catalog import PartConfig
from surgsim.plant.disturbances.base import Disturbance

_LINKS = tuple(f"link{i}" for i in range(1, 8))


class InertiaErrorConfig(PartConfig):
    """Scales mass and inertia of every link of the arm.

    Attributes:
        factor: True mass and inertia over the modelled ones.
    """

    type: Literal["inertia_error"] = "inertia_error"
    factor: Annotated[float, Field(gt=0.1, le=5.0)] = 1.1

    def build(self) -> "InertiaError":
        """The disturbance."""
        return InertiaError(self)


class InertiaError(Disturbance):
    """Mass and inertia of links 1 to 7 times a factor; centres of mass and armature stay."""

    def __init__(self, config: InertiaErrorConfig) -> None:
        self._c = config

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Scale the links."""
        for name in _LINKS:
            body = spec.body(name)
            body.mass = self._c.factor * body.mass
            body.inertia = self._c.factor * np.array(body.inertia)
            full = np.array(body.fullinertia)
            if np.isfinite(full).all():
                body.fullinertia = self._c.factor * full
