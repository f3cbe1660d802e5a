"""The record of a plant whose physics are MuJoCo's."""

import mujoco
import numpy as np

from surgsim.models.build import Scene, span
from surgsim.tick.arrays import World, new

_ARRAYS = sorted(World.ADDRESSES - {"mj_model", "mj_data"})


def world_of(
    scene: Scene,
    data: mujoco.MjData,
    control_period_s: float,
    *,
    disturbed: bool = False,
    touched: bool = False,
) -> World:
    """The record of a plant in MuJoCo's `data`, which must outlive it."""
    model, n = scene.model, len(scene.dof_ids)
    world = new(World, n)
    world.mj_model, world.mj_data = model._address, data._address
    for name in _ARRAYS:
        setattr(world, name, getattr(data, name).ctypes.data)
    world.nq, world.nv, world.nbody = model.nq, model.nv, model.nbody
    world.nsite, world.njnt = model.nsite, model.njnt
    world.first_qpos, world.first_dof = span(scene.qpos_ids).start, span(scene.dof_ids).start
    world.first_ctrl = span(scene.actuator_ids).start
    world.first_joint = int(model.dof_jntid[scene.dof_ids[0]])
    world.tip, world.entry, world.shaft_end = scene.tip_site, scene.shaft_entry_site, scene.shaft_end_site
    world.trocar = -1 if scene.trocar_site is None else scene.trocar_site
    world.mocap = -1 if scene.port_mocap is None else scene.port_mocap
    world.jaws = scene.parts.find(mujoco.mjtObj.mjOBJ_BODY, "jaws")
    world.hinged = int(np.count_nonzero(model.body_parentid == world.jaws))
    world.substeps = round(control_period_s / model.opt.timestep)
    world.disturbed, world.touched, world.walled = disturbed, touched, scene.wall is not None
    world.dt_s, world.timestep_s = control_period_s, model.opt.timestep
    world.tau_max[:] = scene.limits.torque
    world.p_WC[:] = world.p_WC_m[:] = world.f_C[:] = np.nan
    world.q_cmd[:] = np.nan
    world.p_WT_m[:], world.R_WT_m[:] = np.nan, np.nan
    if world.mocap >= 0:
        world.port_home[:] = data.mocap_pos[world.mocap]
    return world
