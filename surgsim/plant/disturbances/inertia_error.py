"""Links that are heavier than the controller's model says."""

from typing import Annotated, Literal

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from surgsim.plant.disturbances.base import Disturbance, DisturbanceConfig, Spread, spread_factor

_LINKS = tuple(f"link{i}" for i in range(1, 8))


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
        return InertiaError(1.0 + (self.factor - 1.0) * spread_factor(rng, self.spread, len(_LINKS)))


class InertiaError(Disturbance):
    """Mass and inertia of links 1 to 7 times a factor each (7,); centres of mass and armature stay."""

    def __init__(self, factors: NDArray[np.float64]) -> None:
        self._factors = factors

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Scale the links."""
        for name, factor in zip(_LINKS, self._factors, strict=True):
            body = spec.body(name)
            body.mass = factor * body.mass
            body.inertia = factor * np.array(body.inertia)
            full = np.array(body.fullinertia)
            if np.isfinite(full).all():
                body.fullinertia = factor * full
