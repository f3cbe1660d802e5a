"""The physical port in a compiled scene: the numbers of the bore's law.

The wall's spring and damper are those of the cannula's joints, which MuJoCo knows about the configured place;
`surgsim.plant.bore.drag` adds what refers them to the moving one, K o + D o'. Why the port is not one of
MuJoCo's own contacts, and figures, are in docs/physical_port.md.
"""

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.models.build import Scene, span
from surgsim.plant.bore import Bore, Push, law
from surgsim.plant.shaft import bend_joints
from surgsim.tick.arrays import new


def new_bore(scene: Scene) -> Bore:
    """The record of the law in `scene`; without a wall zeros, but for how many joints the shaft has."""
    bore = new(Bore, len(scene.dof_ids))
    bore.bends = bend_joints(scene)
    if scene.wall is None:
        return bore
    model, dofs = scene.model, span(scene.cannula_dof_ids)
    slides = span(model.dof_jntid[scene.cannula_dof_ids])
    bore.cannula = int(model.dof_bodyid[dofs.start])
    bore.first_slide, bore.first_dof = slides.start, dofs.start
    bore.parameters[:] = law(scene.wall, scene.clearance_m)
    bore.frame[:] = _rotation(model.body_quat[bore.cannula])
    bore.stiffness[:] = np.array(model.jnt_stiffness[slides]).reshape(3, -1)[:, 0]
    bore.damping[:] = np.array(model.dof_damping[dofs]).reshape(3, -1)[:, 0]
    return bore


def forget(bore: Bore) -> None:
    """Forget the seal's stretch, whether the shaft is in, and all forces."""
    bore.offset[:] = bore.velocity[:] = bore.drive[:] = 0.0
    for name in Push.SHAPES:
        bore.acting[name][:] = 0.0


def _rotation(quat: Array) -> Array:
    """Matrix (3, 3) of a quaternion (wxyz)."""
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, quat)
    return matrix.reshape(3, 3)
