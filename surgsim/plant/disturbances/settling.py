"""Where the cannula rests at the start of a run whose shaft is not in the middle of the port."""

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.models.build import Scene
from surgsim.plant.bore import FUNNEL_LENGTH_M, FUNNEL_SLOPE
from surgsim.plant.records import world_of
from surgsim.plant.shaft import bend_joints, shaft_line

_TURNS = 8
"""In so many the direction of the force settles: the cannula moves far less than the shaft is long."""


def settle_cannula(scene: Scene, data: mujoco.MjData) -> None:
    """Put the cannula where wall and bore are in balance around the shaft of the arm at `data.qpos`.

    The shaft was put through the cannula, which gave way. Else a shaft that is millimetres beside the port
    begins inside the bore's stiff contact, which tears the incision in the first tick.

        K d = -f n,   f = k max(0, n . (C + d - E) - c)

    with the wall's stiffness K, the displacement d of the cannula from its rest C, the contact's stiffness k,
    the bore's clearance c, and n, E as in `surgsim.plant.bore`. Nothing is done without a wall, or to a shaft
    that is not through the cannula.
    """
    wall = scene.wall
    if wall is None:
        return
    model = scene.model
    data.qpos[scene.cannula_qpos_ids] = 0.0
    mujoco.mj_kinematics(model, data)
    cannula = int(model.dof_bodyid[scene.cannula_dof_ids[0]])
    frame = data.xmat[cannula].reshape(3, 3)
    stiffness = (wall.lateral_stiffness_n_per_m,) * 2 + (wall.axial_stiffness_n_per_m,)
    compliance = frame @ np.diag(1.0 / np.array(stiffness)) @ frame.T
    entry, tip = np.zeros(3), np.zeros(3)
    world = world_of(scene, data, float(model.opt.timestep))
    shaft_line(world, bend_joints(scene), data.xpos[cannula], entry, tip)
    d = _balance(
        data.xpos[cannula] - entry,
        tip - entry,
        compliance,
        1.0 / wall.contact_stiffness_n_per_m,
        scene.clearance_m,
    )
    data.qpos[scene.cannula_qpos_ids] = frame.T @ d


def _balance(rest: Array, along: Array, compliance: Array, softness: float, clearance: float) -> Array:
    """The displacement d (3,) [m].

    Args:
        rest: From the shaft's entry to the cannula at rest (3,) [m].
        along: From the shaft's entry to the tip (3,) [m].
        compliance: Inverse of the wall's stiffness (3, 3) [m/N].
        softness: Inverse of the contact's stiffness [m/N].
        clearance: c [m].
    """
    length = float(np.linalg.norm(along))
    u, d = along / length, np.zeros(3)
    for _ in range(_TURNS):
        s = float(u @ (rest + d))
        across = rest + d - s * u
        rho = float(np.linalg.norm(across))
        if not 0.0 <= s <= length or rho == 0.0:
            return np.zeros(3)
        n = across / rho
        gap = clearance + FUNNEL_SLOPE * max(0.0, s - length + FUNNEL_LENGTH_M)
        force = max(0.0, float(n @ rest) - gap) / (softness + float(n @ compliance @ n))
        d = -force * compliance @ n
    return d
