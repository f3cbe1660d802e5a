"""Interface of a disturbance: any of three hooks, each doing nothing by default."""

from typing import Annotated

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from surgsim.catalog import PartConfig
from surgsim.models.build import Scene

Array = NDArray[np.float64]


Spread = Annotated[float, Field(ge=0.0, le=1.0)]
"""Half-width of a uniform relative spread: a value x is drawn from x (1 - spread) to x (1 + spread)."""


def spread_factor(rng: np.random.Generator, spread: float, size: int = 1) -> Array:
    """`size` factors drawn uniformly from 1 - spread to 1 + spread."""
    return 1.0 + spread * rng.uniform(-1.0, 1.0, size)


class DisturbanceConfig(PartConfig):
    """Base of a disturbance's config."""

    def check(self, control_period_s: float) -> None:
        """Refuse what does not fit the scenario.

        Raises:
            ValueError: With the reason.
        """


class Disturbance:
    """A disturbance of the plant. Subclasses override the hooks that they need.

    A config builds it with the run's own random generator, from which its values are drawn if they have a
    spread: the same seed gives the same values.

    `modify` changes the model before it is compiled. `start` is called at every reset with the
    disturbance's own random generator. `act` may change the torque on its way to the joints, and write
    external forces into `xfrc_applied`.
    """

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Change the model before it is compiled."""

    def start(self, scene: Scene, rng: np.random.Generator, dt_s: float) -> None:
        """Forget the last run."""

    def delay(self, torque: Array) -> Array:
        """Torque (7,) [N m] that reaches the joints in this period, given the one commanded."""
        return torque

    def push(self, t_s: float, scene: Scene, data: mujoco.MjData) -> None:
        """Add external forces and torques at `t_s` [s] to `data.xfrc_applied`, zeroed before."""
