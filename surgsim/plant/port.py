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
from surgsim.plant.bore import act, law
from surgsim.plant.truth import arm_view

Array = NDArray[np.float64]
_INSIDE = 1  # in the bore's memory


class Port:
    """Moves the port's place of rest and, with a wall, applies its forces.

    Order in a step: zero `qfrc_applied`, `move`, `mj_step1`, `act`, `mj_step2`; `act`, `force` and `position`
    read the positions that `mj_step1` (or `mj_kinematics`) leaves.
    """

    def __init__(self, scene: Scene, data: mujoco.MjData) -> None:
        self._data = data
        self._row = scene.port_mocap
        self._home = np.zeros(3) if self._row is None else np.array(data.mocap_pos[self._row])
        self.wall = None if scene.wall is None else WallForces(scene, scene.wall, data)

    def reset(self) -> None:
        """Put the place of rest where it is configured and forget the last run; `qpos` is the plant's."""
        if self._row is not None:
            self._data.mocap_pos[self._row] = self._home
        if self.wall is not None:
            self.wall.reset()

    def move(self, offset: Array, velocity: Array) -> None:
        """Put the place of rest `offset` (3,) [m] from the configured one, at `velocity` (3,) [m/s]."""
        if self._row is not None:
            self._data.mocap_pos[self._row] = self._home + offset
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
        return self._home.copy() if self._row is None else np.array(self._data.mocap_pos[self._row])


class WallForces:
    """Motion of the wall, contact and seal as generalized forces on arm and cannula.

    Attributes:
        dofs: Where the cannula is in `qvel`.
        stiffness: Of the cannula's joints (3,) [N/m].
        damping: Of the cannula's joints (3,) [N s/m].
        offset: Displacement of the place of rest in the port's frame (3,) [m].
        velocity: Its velocity (3,) [m/s].
        drive: Generalized force of the wall's motion (nv,).
        contact: Contact's generalized force at the last `act` (nv,).
        seal: Seal's generalized force at the last `act` (nv,).
        stored: Elastic energy in contact and in the seal at the last `act` (2,) [J].
    """

    def __init__(self, scene: Scene, wall: WallConfig, data: mujoco.MjData) -> None:
        model, cannula = scene.model, scene.cannula_dof_ids
        self._data = data
        self._body = int(model.dof_bodyid[cannula[0]])
        self._frame = _rotation(model.body_quat[self._body])
        self.dofs = _span(cannula)
        self.stiffness = np.array(model.jnt_stiffness[_span(model.dof_jntid[cannula])])
        self.damping = np.array(model.dof_damping[self.dofs])
        self.offset, self.velocity, self.stored = np.zeros(3), np.zeros(3), np.zeros(2)
        self.drive, self.contact, self.seal = np.zeros(model.nv), np.zeros(model.nv), np.zeros(model.nv)
        arm, own = _span(scene.dof_ids), self.dofs
        self._state = _views(scene, data)
        self._law = law(wall, scene.clearance_m)
        self._memory, self._trial = np.zeros(4), np.zeros(4)
        self._parts = (self.contact[arm], self.contact[own], self.seal[arm], self.seal[own], self.stored)
        self._unused = (np.zeros(7), np.zeros(3), np.zeros(7), np.zeros(3), np.zeros(2))

    def reset(self) -> None:
        """Forget the seal's stretch, whether the shaft is in, and all forces."""
        for array in (self.offset, self.velocity, self.stored, self.drive, self.contact, self.seal):
            array[:] = 0.0
        self._memory[:] = 0.0

    @property
    def engaged(self) -> bool:
        """Whether the shaft was in the bore at the last `act`."""
        return bool(self._memory[_INSIDE])

    def drag(self, offset: Array, velocity: Array) -> None:
        """Refer the wall's spring and damper to a moved place of rest, by `qfrc_applied`."""
        np.dot(offset, self._frame, out=self.offset)
        np.dot(velocity, self._frame, out=self.velocity)
        pull = self.stiffness * self.offset + self.damping * self.velocity
        self.drive[self.dofs] = pull
        self._data.qfrc_applied[self.dofs] += pull

    def act(self) -> None:
        """Add contact and seal to `qfrc_applied`."""
        act(*self._state, self._law, self._memory, *self._parts)
        applied = self._data.qfrc_applied
        applied += self.contact
        applied += self.seal

    def force(self) -> Array:
        """Force of the shaft on the cannula at the present state (3,) [N]; nothing is remembered."""
        self._trial[:] = self._memory
        return act(*self._state, self._law, self._trial, *self._unused)

    def position(self) -> Array:
        """Centre of the cannula (3,) [m]."""
        return np.array(self._data.xpos[self._body])


def _views(
    scene: Scene, data: mujoco.MjData
) -> tuple[Array, Array, Array, Array, Array, Array, Array, Array]:
    """What `act` reads, not copied: entry, tip, cannula, axes of arm and cannula, and their velocities."""
    model, cannula = scene.model, scene.cannula_dof_ids
    hinges, slides = _span(model.dof_jntid[scene.dof_ids]), _span(model.dof_jntid[cannula])
    return (
        data.site_xpos[scene.shaft_entry_site],
        data.site_xpos[scene.tip_site],
        data.xpos[int(model.dof_bodyid[cannula[0]])],
        data.xanchor[hinges],
        data.xaxis[hinges],
        data.xaxis[slides],
        arm_view(data.qvel, scene.dof_ids),
        arm_view(data.qvel, cannula),
    )


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
