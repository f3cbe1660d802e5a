"""Links that are heavier than the controller's model says."""

from typing import Annotated, Literal

import mujoco
import numpy as np
from pydantic import Field

from surgsim.models.robot import joint_names, link_names
from surgsim.plant.disturbances.base import Disturbance, DisturbanceConfig, Spread, copied, spread_factor


class InertiaErrorConfig(DisturbanceConfig):
    """Scales mass and inertia of every link of the arm.

    Attributes:
        factor: True mass and inertia over the modelled ones.
        spread: Relative spread of the error, factor - 1, over seeds, drawn for each link.
    """

    type: Literal["inertia_error"] = "inertia_error"
    factor: Annotated[float, Field(gt=0.1, le=5.0)] = 1.1

    spread: Spread = 0.0

    def build(self, rng: np.random.Generator) -> "InertiaError":
        """The disturbance, each link's error drawn."""
        return InertiaError(self, rng)


class InertiaError(Disturbance):
    """Mass and inertia of the n links times a factor each; centres of mass and armature stay."""

    def __init__(self, config: InertiaErrorConfig, rng: np.random.Generator) -> None:
        self._c = config
        self._rng = rng

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Scale the links."""
        links = link_names(len(joint_names(spec)))
        errors = (self._c.factor - 1.0) * spread_factor(copied(self._rng), self._c.spread, len(links))
        for name, factor in zip(links, 1.0 + errors, strict=True):
            body = spec.body(name)
            body.mass = factor * body.mass
            body.inertia = factor * np.array(body.inertia)
            full = np.array(body.fullinertia)
            if np.isfinite(full).all():
                body.fullinertia = factor * full
