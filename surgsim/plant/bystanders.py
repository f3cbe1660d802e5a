"""What else moves in the scene besides the arm: its joints for the trace, its force on the tip."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from surgsim.columns import Block, scalar, vector
from surgsim.models.build import Scene
from surgsim.models.robot import JOINTS

Array = NDArray[np.float64]
QUATERNION = ("w", "x", "y", "z")


def joint_columns(model: mujoco.MjModel) -> tuple[tuple[Block, ...], NDArray[np.intp]]:
    """Columns for the positions of every joint that is not the arm's, and their places in `qpos`.

    A free joint has the columns `<name>_{x,y,z}_m` and `<name>_quat_{w,x,y,z}`, a slide `<name>_m`, a hinge
    `<name>_rad`.
    """
    blocks: list[Block] = []
    places: list[int] = []
    for i in range(model.njnt):
        name = model.joint(i).name
        if name in JOINTS:
            continue
        kind, first = model.jnt_type[i], int(model.jnt_qposadr[i])
        if kind == mujoco.mjtJoint.mjJNT_FREE:
            blocks += [vector(name, "m"), Block(f"{name}_quat", QUATERNION, "")]
            places += range(first, first + 7)
        else:
            blocks.append(scalar(name, "m" if kind == mujoco.mjtJoint.mjJNT_SLIDE else "rad"))
            places.append(first)
    return tuple(blocks), np.array(places, dtype=np.intp)


class Bystanders:
    """Reads the other joints' positions, and the force of everything else on the instrument's jaws."""

    def __init__(self, scene: Scene, data: mujoco.MjData) -> None:
        self._model, self._data = scene.model, data
        self.columns, self._places = joint_columns(scene.model)
        jaws = mujoco.mj_name2id(scene.model, mujoco.mjtObj.mjOBJ_BODY, "jaws")
        self._jaws = jaws if jaws >= 0 else None

    def values(self) -> Array:
        """Positions of the other joints now."""
        return np.array(self._data.qpos[self._places])

    def force_on_tip(self) -> Array:
        """Force on the jaws over the last step, world frame (3,) [N]: contact, grasp and applied forces.

        To be read after `mj_step2`, while the step's constraint forces are there.
        """
        if self._jaws is None:
            return np.zeros(3)
        mujoco.mj_rnePostConstraint(self._model, self._data)
        return np.array(self._data.cfrc_ext[self._jaws, 3:])
