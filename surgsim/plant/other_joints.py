"""What else moves in the scene besides the arm: its joints, for the trace."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from surgsim.columns import AXES, Block, scalar, vector
from surgsim.models.named import Named
from surgsim.models.robot import joint_names

QUATERNION = ("w", "x", "y", "z")


def joint_columns(parts: Named) -> tuple[tuple[Block, ...], NDArray[np.intp]]:
    """Columns for the positions of every joint of `parts` that is not the arm's, and their places in `qpos`.

    A free joint has the columns `<name>_{x,y,z}_m` and `<name>_quat_{w,x,y,z}`, a slide `<name>_m`, a hinge
    `<name>_rad`.
    """
    blocks: list[Block] = []
    places: list[int] = []
    arm, model = joint_names(parts), parts.model
    for i, name in parts.joints().items():
        if name in arm:
            continue
        kind, first = model.jnt_type[i], int(model.jnt_qposadr[i])
        if kind == mujoco.mjtJoint.mjJNT_FREE:
            blocks += [vector(name, "m"), Block(f"{name}_quat", QUATERNION, "")]
            places += range(first, first + len(AXES) + len(QUATERNION))
        else:
            blocks.append(scalar(name, "m" if kind == mujoco.mjtJoint.mjJNT_SLIDE else "rad"))
            places.append(first)
    return tuple(blocks), np.array(places, dtype=np.intp)
