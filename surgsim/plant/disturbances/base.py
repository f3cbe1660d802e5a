"""Interface of a disturbance: any of three hooks, each doing nothing by default."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from surgsim.models.build import Scene

Array = NDArray[np.float64]


class Disturbance:
    """A disturbance of the plant. Subclasses override the hooks that they need.

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
