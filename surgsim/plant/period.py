"""A control period of the dynamic plant, in pieces: of one arm alone, and of one that shares its physics.

The pieces are the same for both. Between them time passes for the whole model at once, so that several arms
go from piece to piece together: all hand over their torques, all are pushed, MuJoCo steps, all look.
"""

import math
from functools import cache
from typing import Any

from numba import types

from surgsim.compiled import compiled
from surgsim.plant.bore import Bore, act, drag, wall_force
from surgsim.plant.shaft import see_bent
from surgsim.plant.world import (
    ACTUATE,
    AFTER_STEP,
    BEFORE_STEP,
    GRIP,
    PORT_MOTION,
    PUSH,
    SENSE,
    VALUES,
    Hooks,
    call_hooks,
)
from surgsim.tick.arrays import World, type_of
from surgsim.tick.mujoco_calls import mj_rnePostConstraint, mj_step1, mj_step2
from surgsim.tick.status import GOES_ON
from surgsim.tick.views import doubles, site_place, vector

COMMANDED, CLEARED, MOVED, PUSHED, STEPPED, ENDED, HELD, SEEN = range(8)
"""Stages of a period, for an arm that goes from one to the next with others."""


@cache
def stage_signature(n: int) -> Any:
    """Status = of_several(stage, k, world, bore, hooks) for n joints."""
    records = (type_of(World, n), type_of(Bore, n), type_of(Hooks, 0))
    return types.int64(types.int64, types.int64, *records)


@compiled
def clear(world: World) -> None:
    """Forces of the last step are forgotten."""
    if world.disturbed:
        vector(world.xfrc_applied, 6 * world.nbody)[:] = 0.0
        vector(world.qfrc_applied, world.nv)[:] = 0.0


@compiled
def move_port(world: World, bore: Bore, hooks: Hooks, t_s: float) -> int:
    """The port is moved to where it is at `t_s` [s]."""
    world.step_s = t_s
    if not world.disturbed:
        return GOES_ON
    world.port_offset[:] = 0.0
    world.port_velocity[:] = 0.0
    status = call_hooks(PORT_MOTION, hooks, world)
    if world.mocap >= 0:
        place = vector(world.mocap_pos + 24 * world.mocap, 3)
        for i in range(3):
            place[i] = world.port_home[i] + world.port_offset[i]
    if world.walled and status == GOES_ON:
        drag(bore, world)
    return status


@compiled
def look(world: World, bore: Bore, hooks: Hooks) -> int:
    """Fill what is true and what is measured, after `mj_step1`."""
    see_arm(world)
    see_bent(world, bore.bends)
    for i in range(3):
        world.f_T_m[i] = world.f_T[i]
    if world.walled:
        wall_force(bore, world, world.f_C)
    for i in range(world.q.size):
        world.tau_m[i] = world.tau[i]
    status = call_hooks(VALUES, hooks, world)
    return status if status != GOES_ON else call_hooks(SENSE, hooks, world)


@compiled
def see_arm(world: World) -> None:
    """Fill joints, tip, shaft and trocar, true and as measured without error."""
    qpos, qvel = vector(world.qpos, world.nq), vector(world.qvel, world.nv)
    for i in range(world.q.size):
        world.q[i] = world.q_m[i] = qpos[world.first_qpos + i]
        world.v[i] = world.v_m[i] = qvel[world.first_dof + i]
    tip, wrist = site_place(world, world.tip), site_place(world, world.entry)
    end = site_place(world, world.shaft_end)
    for i in range(3):
        world.p_WT[i], world.p_WS[i], world.p_WR[i] = tip[i], end[i], wrist[i]
        world.p_WC[i] = math.nan if world.trocar < 0 else site_place(world, world.trocar)[i]
        world.p_WC_m[i], world.v_WC_m[i] = world.p_WC[i], 0.0
    world.tracked_samples = 0


@compiled
def hold_at_first(world: World) -> None:
    """The arm at rest is held by the torques that it needs."""
    gravity = vector(world.qfrc_bias, world.nv)
    for i in range(world.q.size):
        world.tau[i] = gravity[world.first_dof + i]


@compiled
def begin(world: World, bore: Bore, hooks: Hooks) -> int:
    """The first instant of a run."""
    clear(world)
    status = move_port(world, bore, hooks, 0.0)
    if status != GOES_ON:
        return status
    mj_step1(world.mj_model, world.mj_data)
    hold_at_first(world)
    return look(world, bore, hooks)


@compiled
def command(world: World, hooks: Hooks) -> int:
    """Let `world.torque`, saturated at the limits, go to the motors."""
    ctrl = vector(world.ctrl, world.first_ctrl + world.q.size)
    for i in range(world.q.size):
        world.torque[i] = min(max(world.torque[i], -world.tau_max[i]), world.tau_max[i])
    status = call_hooks(ACTUATE, hooks, world)
    if status == GOES_ON:
        status = call_hooks(GRIP, hooks, world)
    if status != GOES_ON:
        return status
    for i in range(world.q.size):
        world.tau[i] = ctrl[world.first_ctrl + i] = world.torque[i]
    return GOES_ON


@compiled
def push(world: World, bore: Bore, hooks: Hooks, t_s: float) -> int:
    """What acts on the arm in the physics step from `t_s` [s] on, between `mj_step1` and `mj_step2`."""
    world.step_s = t_s
    status = call_hooks(PUSH, hooks, world)
    if status != GOES_ON:
        return status
    if world.walled:
        act(bore, world)
    return call_hooks(BEFORE_STEP, hooks, world)


@compiled
def end_period(world: World) -> None:
    """The force on the tip is measured, and the time is that of the next tick."""
    if world.touched and world.jaws >= 0:
        mj_rnePostConstraint(world.mj_model, world.mj_data)
        wrenches = doubles(world.cfrc_ext, world.nbody, 6)
        for i in range(3):
            world.f_T[i] = wrenches[world.jaws, 3 + i]
            for k in range(world.jaws + 1, world.jaws + 1 + world.hinged):
                world.f_T[i] += wrenches[k, 3 + i]
    world.tick += 1
    world.t_s = world.tick * world.dt_s


@compiled
def advance_dynamics(world: World, bore: Bore, hooks: Hooks) -> int:
    """Let `world.torque`, saturated at the limits, act for one control period.

    A hook that does not go on ends it there: nothing further is stepped or called.
    """
    m, d = world.mj_model, world.mj_data
    status = command(world, hooks)
    if status != GOES_ON:
        return status
    start = world.tick * world.dt_s
    for k in range(world.substeps):
        t = start + k * world.timestep_s
        if k > 0:
            clear(world)
            status = move_port(world, bore, hooks, t)
            if status != GOES_ON:
                return status
            mj_step1(m, d)
        status = push(world, bore, hooks, t)
        if status != GOES_ON:
            return status
        mj_step2(m, d)
        status = call_hooks(AFTER_STEP, hooks, world)
        if status != GOES_ON:
            return status
    end_period(world)
    clear(world)
    status = move_port(world, bore, hooks, world.t_s)
    if status != GOES_ON:
        return status
    mj_step1(m, d)
    return look(world, bore, hooks)


@compiled
def of_several(stage: int, k: int, world: World, bore: Bore, hooks: Hooks) -> int:
    """A stage of the period for one of several arms; `k` counts the physics steps of the period."""
    status, t = GOES_ON, world.tick * world.dt_s + k * world.timestep_s
    if stage == COMMANDED:
        status = command(world, hooks)
    elif stage == CLEARED:
        clear(world)
    elif stage == MOVED:
        status = move_port(world, bore, hooks, t)
    elif stage == PUSHED:
        status = push(world, bore, hooks, t)
    elif stage == STEPPED:
        status = call_hooks(AFTER_STEP, hooks, world)
    elif stage == ENDED:
        end_period(world)
    elif stage == HELD:
        hold_at_first(world)
    else:
        status = look(world, bore, hooks)
    return status
