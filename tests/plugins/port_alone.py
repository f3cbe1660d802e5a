"""The physical port outside a plant: its kernels on a model that a test steps itself."""

import mujoco
import numpy as np

from surgsim.models.build import Scene
from surgsim.plant.bore import act, drag, wall_force
from surgsim.plant.port import forget, new_bore
from surgsim.plant.records import world_of


class Port:
    """Moves the port's place of rest and, with a wall, applies its forces.

    Order in a step: zero `qfrc_applied`, `move`, `mj_step1`, `act`, `mj_step2`; `act`, `force` and `position`
    read the positions that `mj_step1` (or `mj_kinematics`) leaves.
    """

    def __init__(self, scene: Scene, data: mujoco.MjData) -> None:
        self._scene, self._data, self._row = scene, data, scene.port_mocap
        self._world = world_of(scene, data, float(scene.model.opt.timestep))
        self.bore = new_bore(scene)

    def reset(self) -> None:
        """Put the place of rest where it is configured and forget the last run."""
        self._data.mocap_pos[self._row] = self._world.port_home
        forget(self.bore)

    def move(self, offset: np.ndarray, velocity: np.ndarray) -> None:
        """Put the place of rest `offset` (3,) [m] from the configured one, at `velocity` (3,) [m/s]."""
        self._data.mocap_pos[self._row] = self._world.port_home + offset
        self._world.port_offset[:], self._world.port_velocity[:] = offset, velocity
        if self._scene.wall is not None:
            drag(self.bore, self._world)

    def act(self) -> None:
        """Add the forces between shaft and cannula to `qfrc_applied`."""
        if self._scene.wall is not None:
            act(self.bore, self._world)

    def force(self) -> np.ndarray:
        """Force of the shaft on the wall now (3,) [N], world frame; zeros without a wall."""
        out = np.zeros(3)
        if self._scene.wall is not None:
            wall_force(self.bore, self._world, out)
        return out

    def position(self) -> np.ndarray:
        """Centre of the cannula now (3,) [m], world frame; of the place of rest without a wall."""
        return self.rest() if self._scene.wall is None else np.array(self._data.xpos[self.bore.cannula])

    def rest(self) -> np.ndarray:
        """Place of rest of the port (3,) [m], world frame."""
        return np.array(self._data.mocap_pos[self._row])

    @property
    def engaged(self) -> bool:
        """Whether the shaft was in the bore at the last `act`."""
        return bool(self.bore.acting.memory[1])
