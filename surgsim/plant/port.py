"""The port under the shaft: its place of rest, and with a wall the forces on cannula and arm.

The wall's spring and damper are those of the cannula's joints, which MuJoCo knows about the configured place;
`move` adds what refers them to the moving one, K o + D o'. The law of the bore is in `surgsim.plant.bore`.
Why it is not one of MuJoCo's own contacts, and figures, are in docs/physical_port.md.
"""

import mujoco
import numpy as np
from numpy.typing import NDArray

from surgsim.models.build import Scene
from surgsim.models.config import WallConfig
from surgsim.plant.bore import Bore, Push, act, drag, law, wall_force
from surgsim.plant.records import world_of
from surgsim.tick.arrays import World, new

Array = NDArray[np.float64]
_INSIDE = 1  # in the bore's memory


class Port:
    """Moves the port's place of rest and, with a wall, applies its forces.

    Order in a step: zero `qfrc_applied`, `move`, `mj_step1`, `act`, `mj_step2`; `act`, `force` and `position`
    read the positions that `mj_step1` (or `mj_kinematics`) leaves. The plant's kernel does the same on the
    records.

    Attributes:
        bore: The record of the bore's law; not used without a wall.
        wall: The wall's forces, or None.
    """

    def __init__(self, scene: Scene, data: mujoco.MjData, world: World | None = None) -> None:
        self._data = data
        self._row = scene.port_mocap
        self._world = world_of(scene, data, float(scene.model.opt.timestep)) if world is None else world
        self.bore = new(Bore, len(scene.dof_ids))
        self.wall = (
            None if scene.wall is None else WallForces(scene, scene.wall, data, self._world, self.bore)
        )

    def reset(self) -> None:
        """Put the place of rest where it is configured and forget the last run; `qpos` is the plant's."""
        if self._row is not None:
            self._data.mocap_pos[self._row] = self._world.port_home
        if self.wall is not None:
            self.wall.reset()

    def move(self, offset: Array, velocity: Array) -> None:
        """Put the place of rest `offset` (3,) [m] from the configured one, at `velocity` (3,) [m/s]."""
        if self._row is not None:
            self._data.mocap_pos[self._row] = self._world.port_home + offset
        if self.wall is not None:
            self.wall.drag(offset, velocity)

    def act(self) -> None:
        """Add the forces between shaft and cannula to `qfrc_applied`."""
        if self.wall is not None:
            self.wall.act()

    def force(self) -> Array:
        """Force of the shaft on the wall now (3,) [N], world frame; zeros without a wall."""
        return np.zeros(3) if self.wall is None else self.wall.force()

    def position(self) -> Array:
        """Centre of the cannula now (3,) [m], world frame; of the place of rest without a wall."""
        return self.rest() if self.wall is None else self.wall.position()

    def rest(self) -> Array:
        """Place of rest of the port (3,) [m], world frame."""
        home: Array = self._world.port_home.copy()
        return home if self._row is None else np.array(self._data.mocap_pos[self._row])


class WallForces:
    """Motion of the wall, contact and seal as generalized forces on arm and cannula.

    Attributes:
        dofs: Where the cannula is in `qvel`.
        bore: The record of the law.
    """

    def __init__(self, scene: Scene, wall: WallConfig, data: mujoco.MjData, world: World, bore: Bore) -> None:
        model, cannula = scene.model, scene.cannula_dof_ids
        self._data, self._world, self.bore = data, world, bore
        self.dofs, self._arm, self._nv = _span(cannula), _span(scene.dof_ids), model.nv
        slides = _span(model.dof_jntid[cannula])
        bore.cannula = int(model.dof_bodyid[cannula[0]])
        bore.first_slide, bore.first_dof = slides.start, self.dofs.start
        bore.parameters[:] = law(wall, scene.clearance_m)
        bore.frame[:] = _rotation(model.body_quat[bore.cannula])
        bore.stiffness[:] = np.array(model.jnt_stiffness[slides]).reshape(3, -1)[:, 0]
        bore.damping[:] = np.array(model.dof_damping[self.dofs]).reshape(3, -1)[:, 0]

    @property
    def stiffness(self) -> Array:
        """Of the cannula's joints (3,) [N/m]."""
        return np.array(self.bore.stiffness)

    @property
    def damping(self) -> Array:
        """Of the cannula's joints (3,) [N s/m]."""
        return np.array(self.bore.damping)

    @property
    def offset(self) -> Array:
        """Displacement of the place of rest in the port's frame (3,) [m]."""
        return np.array(self.bore.offset)

    @property
    def velocity(self) -> Array:
        """Its velocity (3,) [m/s]."""
        return np.array(self.bore.velocity)

    @property
    def stored(self) -> Array:
        """Elastic energy in contact and in the seal at the last `act` (2,) [J]."""
        return np.array(self.bore.acting.stored)

    @property
    def drive(self) -> Array:
        """Generalized force of the wall's motion (nv,)."""
        return self._generalized(np.zeros(self._arm.stop - self._arm.start), self.bore.drive)

    @property
    def contact(self) -> Array:
        """Contact's generalized force at the last `act` (nv,)."""
        return self._generalized(self.bore.acting.contact_arm, self.bore.acting.contact_cannula)

    @property
    def seal(self) -> Array:
        """Seal's generalized force at the last `act` (nv,)."""
        return self._generalized(self.bore.acting.seal_arm, self.bore.acting.seal_cannula)

    def _generalized(self, arm: Array, cannula: Array) -> Array:
        out = np.zeros(self._nv)
        out[self._arm], out[self.dofs] = arm, cannula
        return out

    def reset(self) -> None:
        """Forget the seal's stretch, whether the shaft is in, and all forces."""
        bore = self.bore
        bore.offset[:] = bore.velocity[:] = bore.drive[:] = 0.0
        for name in Push.SHAPES:
            getattr(bore.acting, name)[:] = 0.0

    @property
    def engaged(self) -> bool:
        """Whether the shaft was in the bore at the last `act`."""
        return bool(self.bore.acting.memory[_INSIDE])

    def drag(self, offset: Array, velocity: Array) -> None:
        """Refer the wall's spring and damper to a moved place of rest, by `qfrc_applied`."""
        self._world.port_offset[:], self._world.port_velocity[:] = offset, velocity
        drag(self.bore, self._world)

    def act(self) -> None:
        """Add contact and seal to `qfrc_applied`."""
        act(self.bore, self._world)

    def force(self) -> Array:
        """Force of the shaft on the cannula at the present state (3,) [N]; nothing is remembered."""
        out = np.zeros(3)
        wall_force(self.bore, self._world, out)
        return out

    def position(self) -> Array:
        """Centre of the cannula (3,) [m]."""
        return np.array(self._data.xpos[self.bore.cannula])


def _rotation(quat: Array) -> Array:
    """Matrix (3, 3) of a quaternion (wxyz)."""
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, quat)
    return matrix.reshape(3, 3)


def _span(ids: NDArray[np.intp]) -> slice:
    """Ids that follow each other, as a slice: MuJoCo's data is then seen without a copy."""
    first = int(ids[0])
    if not np.array_equal(ids, np.arange(first, first + len(ids))):
        raise ValueError(f"the ids {ids} do not follow each other")
    return slice(first, first + len(ids))
