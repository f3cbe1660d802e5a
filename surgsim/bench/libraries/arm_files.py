"""The arm as other libraries read it: a URDF of its joints, with the trocar as a frame."""

import mujoco

from surgsim.array import Array
from surgsim.models.arm import ArmModel
from surgsim.models.texts import TIP
from surgsim.models.texts import urdf_of as urdf_with

__all__ = ["TIP", "TROCAR", "base_pose", "urdf_of"]


TROCAR = "trocar"
"""Frame of the URDF beside those of the links and the tip."""


def base_pose(arm: ArmModel) -> tuple[Array, Array]:
    """Position (3,) [m] and rotation (3, 3) of the arm's base in the world."""
    model = arm.scene.model
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0
    mujoco.mj_kinematics(model, data)
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "base")
    if body < 0:
        body = int(model.body_parentid[model.jnt_bodyid[0]])
    return data.xpos[body].copy(), data.xmat[body].reshape(3, 3).copy()


def urdf_of(arm: ArmModel, p_WC: Array) -> str:
    """The arm's joints, their limits, the tip, and the trocar at `p_WC` (3,) [m] fixed to the world."""
    return urdf_with(arm, {TROCAR: p_WC})
