"""The arm as other libraries read it: a URDF of its joints, written from the compiled model."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from surgsim.models.arm import ArmModel

Array = NDArray[np.float64]

TIP, TROCAR = "tip", "trocar"
"""Frames of the URDF beside those of the links."""


def base_pose(arm: ArmModel) -> tuple[Array, Array]:
    """Position (3,) [m] and rotation (3, 3) of the arm's base in the world."""
    model, data = arm.scene.model, _placed(arm)
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "base")
    if body < 0:
        body = int(model.body_parentid[model.jnt_bodyid[0]])
    return data.xpos[body].copy(), data.xmat[body].reshape(3, 3).copy()


def urdf_of(arm: ArmModel, p_WC: Array) -> str:
    """The arm's joints, their limits, the tip, and the trocar at `p_WC` (3,) [m] fixed to the world."""
    model, data, limits = arm.scene.model, _placed(arm), arm.limits
    lines = ['<robot name="arm">', _link("world")]
    parent, at, turn = "world", np.zeros(3), np.eye(3)
    for i in range(model.njnt):
        joint, link = f"joint{i + 1}", f"link{i + 1}"
        R = data.xmat[model.jnt_bodyid[i]].reshape(3, 3)
        where = _origin(at, turn, data.xanchor[i], R)
        span = f'lower="{limits.q_min[i]:.17g}" upper="{limits.q_max[i]:.17g}"'
        speed = f'velocity="{limits.velocity[i]:.17g}" effort="{limits.torque[i]:.17g}"'
        lines += [
            _link(link),
            f'<joint name="{joint}" type="revolute"><parent link="{parent}"/><child link="{link}"/>{where}'
            f'<axis xyz="{_text(model.jnt_axis[i])}"/><limit {span} {speed}/></joint>',
        ]
        parent, at, turn = link, data.xanchor[i], R
    site = arm.scene.tip_site
    tip = _origin(at, turn, data.site_xpos[site], data.site_xmat[site].reshape(3, 3))
    lines += _fixed(TIP, parent, tip)
    lines += _fixed(TROCAR, "world", _origin(np.zeros(3), np.eye(3), p_WC, np.eye(3)))
    return "\n".join([*lines, "</robot>"])


def _placed(arm: ArmModel) -> mujoco.MjData:
    data = mujoco.MjData(arm.scene.model)
    data.qpos[:] = 0.0
    mujoco.mj_kinematics(arm.scene.model, data)
    return data


def _link(name: str) -> str:
    inertia = '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>'
    return f'<link name="{name}"><inertial><mass value="1"/>{inertia}</inertial></link>'


def _fixed(name: str, parent: str, where: str) -> list[str]:
    joint = (
        f'<joint name="to_{name}" type="fixed"><parent link="{parent}"/><child link="{name}"/>{where}</joint>'
    )
    return [_link(name), joint]


def _origin(p: Array, R: Array, p_child: Array, R_child: Array) -> str:
    """The child's place in its parent, with roll, pitch and yaw."""
    A = R.T @ R_child
    pitch = np.arctan2(-A[2, 0], np.hypot(A[0, 0], A[1, 0]))
    if np.hypot(A[0, 0], A[1, 0]) > 1e-9:
        roll, yaw = np.arctan2(A[2, 1], A[2, 2]), np.arctan2(A[1, 0], A[0, 0])
    else:
        roll, yaw = np.arctan2(-A[1, 2], A[1, 1]), 0.0
    return f'<origin xyz="{_text(R.T @ (p_child - p))}" rpy="{_text(np.array([roll, pitch, yaw]))}"/>'


def _text(values: Array) -> str:
    return " ".join(f"{value:.17g}" for value in values)
