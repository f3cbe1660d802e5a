"""Axes and quaternions, and where a file's bodies are with all joints at their zero."""

import mujoco
import numpy as np

from surgsim.array import Array


def axes_of(quaternion: Array) -> Array:
    """Axes (3, 3) of a unit quaternion wxyz (4,)."""
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, quaternion)
    return turn.reshape(3, 3)


def quaternion_of(axes: Array) -> Array:
    """Quaternion wxyz (4,) of axes (3, 3)."""
    found = np.zeros(4)
    mujoco.mju_mat2Quat(found, np.ascontiguousarray(axes).ravel())
    return found


def at_zero(model: mujoco.MjModel) -> mujoco.MjData:
    """Where everything is with all joints at their zero."""
    data = mujoco.MjData(model)
    data.qpos[:] = model.qpos0
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return data
