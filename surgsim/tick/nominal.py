"""The nominal model of the arm, evaluated from compiled code."""

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.tick.algebra import cross, dot
from surgsim.tick.arrays import Model, Seen
from surgsim.tick.mujoco_calls import (
    mj_comPos,
    mj_comVel,
    mj_fullM,
    mj_jacSite,
    mj_kinematics,
    mj_makeM,
    mj_rne,
)
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.views import doubles, vector


@compiled
def place(model: Model, q: Array) -> None:
    """Place bodies and sites of the nominal geometry at `q` (n,) [rad], without any correction."""
    qpos = vector(model.qpos, q.size)
    for i in range(q.size):
        qpos[i] = model.q[i] = q[i]
    mj_kinematics(model.mj_model, model.mj_data)


@compiled
def kinematics(model: Model, q: Array) -> None:
    """Evaluate the kinematics at `q` (n,) [rad], with the correction of the tip if there is one."""
    n = q.size
    place(model, q)
    mj_comPos(model.mj_model, model.mj_data)
    mj_jacSite(model.mj_model, model.mj_data, model.Jv_WT.ctypes.data, model.Jw_WT.ctypes.data, model.site)
    tip, turn = vector(model.site_xpos, 3), doubles(model.site_xmat, 3, 3)
    axes, anchors = doubles(model.xaxis, n, 3), doubles(model.xanchor, n, 3)
    for k in range(3):
        model.p_WT[k] = tip[k]
        for i in range(3):
            model.R_WT[i, k] = turn[i, k]
        for i in range(n):
            model.z_W[i, k] = axes[i, k]
            model.anchors_W[i, k] = anchors[i, k]
    if model.corrected:
        _correct(model)
    model.p_WS[:] = model.p_WT
    model.Jv_WS[:] = model.Jv_WT
    if model.angled:
        _go_to_end(model)


@compiled
def _go_to_end(model: Model) -> None:
    """The shaft's end, r from the tip: p_WS = p_WT + r,   Jv_WS = Jv_WT - [r]x Jw_WT,   r = R_WT p_TS."""
    r, axis, moved = scratch(3), scratch(3), scratch(3)
    for i in range(3):
        r[i] = dot(model.R_WT[i], model.p_TS)
        model.p_WS[i] += r[i]
    for j in range(model.q.size):
        for i in range(3):
            axis[i] = model.Jw_WT[i, j]
        cross(axis, r, moved)
        for i in range(3):
            model.Jv_WS[i, j] += moved[i]


@compiled
def _correct(model: Model) -> None:
    """Tip and shaft where they are believed to be, and the Jacobian of that point of the instrument.

        p_WT = p_WN + r,   R_WT = R_WN R_NT,   Jv_WT = Jv_WN - [r]x Jw_WN,   r = R_WN p_NT

    with the nominal tip N. The correction is that of the instrument as if it were bent once: how it changes
    with the joints is not in the Jacobians.
    """
    nominal, r, axis, moved = scratch_matrix(3, 3), scratch(3), scratch(3), scratch(3)
    nominal[:] = model.R_WT
    for i in range(3):
        r[i] = 0.0
        for j in range(3):
            r[i] += nominal[i, j] * model.p_NT[j]
            s = 0.0
            for k in range(3):
                s += nominal[i, k] * model.R_NT[k, j]
            model.R_WT[i, j] = s
        model.p_WT[i] += r[i]
    for j in range(model.q.size):
        for i in range(3):
            axis[i] = model.Jw_WT[i, j]
        cross(axis, r, moved)
        for i in range(3):
            model.Jv_WT[i, j] += moved[i]


@compiled
def dynamics(model: Model, v: Array) -> None:
    """Evaluate inertia and bias for the velocities `v` (n,) [rad/s]; after `kinematics`."""
    qvel = vector(model.qvel, v.size)
    for i in range(v.size):
        qvel[i] = model.v[i] = v[i]
    mj_comVel(model.mj_model, model.mj_data)
    mj_rne(model.mj_model, model.mj_data, 0, model.bias.ctypes.data)
    mj_makeM(model.mj_model, model.mj_data)
    mj_fullM(model.mj_model, model.mj_data, model.M.ctypes.data)


@compiled
def copy_model(a: Model | Seen, b: Model | Seen) -> None:
    """Copy what was evaluated from a record with a model's fields to another."""
    b.q[:] = a.q
    b.v[:] = a.v
    b.p_WT[:] = a.p_WT
    b.R_WT[:] = a.R_WT
    b.Jv_WT[:] = a.Jv_WT
    b.Jw_WT[:] = a.Jw_WT
    b.p_WS[:] = a.p_WS
    b.Jv_WS[:] = a.Jv_WS
    b.z_W[:] = a.z_W
    b.anchors_W[:] = a.anchors_W
    b.M[:] = a.M
    b.bias[:] = a.bias
