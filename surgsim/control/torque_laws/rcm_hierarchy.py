"""The hierarchy of the laws of inverse dynamics: RCM over tip over posture, at acceleration level."""

import math

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.control.acceleration import TORQUE_SHARE, allows, fill_acceleration_bounds, prioritised
from surgsim.control.manipulability import fill_velocity_products
from surgsim.control.rcm import fill_rcm, fill_rcm_bias
from surgsim.control.tip_energy import fill_held_inertia, limit_press, throttle
from surgsim.tick.algebra import (
    back_substitute,
    back_substitute_rows,
    dot,
    factor,
    outer_product,
    times,
    transposed_times,
)
from surgsim.tick.arrays import Model, Seen
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.status import GOES_ON, RANK_LOST

K_RCM, D_RCM, K_TIP, D_TIP, K_JOINT, D_JOINT, SENSOR_DELAY, YIELDS, VALVE, PRESS = range(10)
"""Places of the gains, with which those of a law begin. The first six go with the bandwidth squared, or with
the bandwidth, in turn."""
HIERARCHY_GAINS = 10
TIP, RCM, JOINT, BIAS, DISTURBANCE, LIMITS = range(6)
"""Rows of the terms."""
TERMS = ("tip", "rcm", "joint", "bias", "observer", "limits")
Pair = tuple[float, float]


def hierarchy_gains(rcm: Pair, tip: Pair, joint: Pair, *further: float) -> list[float]:
    """The gains (HIERARCHY_GAINS,) with which those of a law begin.

    Args:
        rcm: Stiffness k [1/s^2] and damping ratio z of the error's dynamics e'' + 2 z sqrt(k) e' + k e = 0.
        tip: Of the tip, likewise.
        joint: Of the posture.
        further: From `SENSOR_DELAY` on; the others are 0.
    """
    own = [gain for k, ratio in (rcm, tip, joint) for gain in (k, 2.0 * ratio * k**0.5)]
    return [*own, *further, *[0.0] * (HIERARCHY_GAINS - len(own) - len(further))]


@compiled
def fill_task_errors(
    seen: Seen, model: Model, late: float, ahead: float, J: Array, error: Array, rate: Array, bias: Array
) -> None:
    """Errors of tip and RCM, and how they change, at `model`'s state.

    With joint accelerations q'' the second derivative of `error` is J q'' + bias.

    Args:
        seen: Command and trocar.
        model: The arm at the state.
        late: How far the state is from now [s]; the trocar is carried over it.
        ahead: How far the command is carried on [s].
        J: Filled with the rows of tip and RCM (m, n), m = 3 without a trocar, else 5.
        error: Filled with p - p_d and e_N (m,) [m].
        rate: Filled with their rates (m,) [m/s].
        bias: Filled with J' q' less the acceleration of the reference (m,) [m/s^2].
    """
    linear, angular, speed = scratch(3), scratch(3), scratch(3)
    fill_velocity_products(model.Jv_WT, model.z_W, model.v, linear, angular)
    times(model.Jv_WT, model.v, speed)
    for i in range(3):
        J[i] = model.Jv_WT[i]
        error[i] = model.p_WT[i] - (seen.p_WTd[i] + ahead * (seen.v_WTd[i] + 0.5 * ahead * seen.a_WTd[i]))
        rate[i] = speed[i] - (seen.v_WTd[i] + ahead * seen.a_WTd[i])
        bias[i] = linear[i] - seen.a_WTd[i]
    if error.size == 3:
        return
    p_WC, v_WC = scratch(3), scratch(3)
    for i in range(3):
        p_WC[i] = seen.p_WC[i] + late * (seen.v_WC[i] + 0.5 * late * seen.a_WC[i])
        v_WC[i] = seen.v_WC[i] + late * seen.a_WC[i]
    moving, curved = scratch(2), scratch(2)
    normals = scratch_matrix(2, 3)
    if model.angled:
        fill_velocity_products(model.Jv_WS, model.z_W, model.v, linear, angular)
    fill_rcm(model.p_WS, model.R_WT, model.Jv_WS, model.Jw_WT, p_WC, v_WC, error[3:], J[3:], moving, normals)
    fill_rcm_bias(
        model.p_WS, model.R_WT, model.Jv_WS, model.Jw_WT, model.v, p_WC, v_WC, linear, angular, curved
    )
    for i in range(2):
        rate[3 + i] = dot(J[3 + i], model.v) - moving[i]
        bias[3 + i] = curved[i] - dot(normals[i], seen.a_WC)


@compiled
def _task_accelerations(
    gains: Array, seen: Seen, model: Model, late: float, share: float, J: Array, a: Array
) -> None:
    """Fill rows J (m, n) and accelerations a (m,) of tip and RCM at `model`'s state, `late` [s] from now."""
    error, rate, bias = scratch(5), scratch(5), scratch(5)
    m, square = a.size, share * share
    ahead = max(late - gains[SENSOR_DELAY], 0.0)
    fill_task_errors(seen, model, late, ahead, J, error[:m], rate[:m], bias[:m])
    for i in range(m):
        stiffness, damping = (gains[K_TIP], gains[D_TIP]) if i < 3 else (gains[K_RCM], gains[D_RCM])
        a[i] = -bias[i] - (square * stiffness * error[i] + share * damping * rate[i])


@compiled
def fill_touch(gains: Array, seen: Seen, touch: Array) -> None:
    """Torque J_T' f of the measured force on the tip that is yielded to (n,) [N m]; 0 where none is."""
    touch[:] = 0.0
    if gains[YIELDS] != 0.0:
        transposed_times(seen.Jv_WT, seen.f_T, touch)


@compiled
def _give_way(inertia: Array, f: Array, a: Array) -> bool:
    """Add to `a` the acceleration of the tip along the force `f` on it, its inertia (3, 3) [kg] destroyed."""
    size, moved = dot(f, f), scratch(3)
    if size == 0.0:
        return True
    moved[:] = f
    if not factor(inertia):
        return False
    back_substitute(inertia, moved)
    share = dot(f, moved) / size
    for i in range(3):
        a[i] += f[i] * share
    return True


@compiled
def _let_through(gains: Array, model: Model, inertia: Array, seen: Seen, a: Array) -> None:
    """Limit what drives the tip in `a`, rows J q'': all of it but what its curvature takes."""
    linear, angular, speed, drive = scratch(3), scratch(3), scratch(3), scratch(3)
    fill_velocity_products(model.Jv_WT, model.z_W, model.v, linear, angular)
    times(model.Jv_WT, model.v, speed)
    for i in range(3):
        drive[i] = a[i] + linear[i]
    if gains[PRESS] > 0.0:
        limit_press(inertia, seen.f_T, gains[PRESS], drive)
    if gains[VALVE] != 0.0 and math.isfinite(seen.budget_j):
        throttle(inertia, speed, seen.budget_j, seen.dt_s, drive)
    for i in range(3):
        a[i] = drive[i] - linear[i]


@compiled
def fill_demand(
    gains: Array, seen: Seen, model: Model, late: float, share: float, J: Array, a: Array, posture: Array
) -> None:
    """What the tasks ask for at `model`'s state, which is reached `late` [s] from now.

    Args:
        gains: They begin with those of the hierarchy.
        seen: Command, joint reference and trocar of now.
        model: The arm then.
        late: How much later that is than now [s].
        share: Share of the bandwidths that is used.
        J: Filled with the rows of tip and RCM (3 or 5, n).
        a: Filled with their accelerations (3 or 5,) [m/s^2].
        posture: Filled with the posture's (n,) [rad/s^2].
    """
    _task_accelerations(gains, seen, model, late, share, J, a)
    ahead = max(late - gains[SENSOR_DELAY], 0.0)
    for i in range(posture.size):
        gap = seen.q_ref[i] + ahead * seen.qdot_ref[i] - model.q[i]
        turning = share * gains[D_JOINT] * (seen.qdot_ref[i] - model.v[i])
        posture[i] = share * share * gains[K_JOINT] * gap + turning


@compiled
def fill_terms(
    gains: Array, seen: Seen, model: Model, late: float, d: Array, share: float, out: Array
) -> int:
    """Fill the terms of the torque for the state of `model`, which is reached `late` [s] from now."""
    n, m, M = seen.q.size, 3 + seen.rows, model.M
    J, a, posture = scratch_matrix(m, n), scratch(m), scratch(n)
    fill_demand(gains, seen, model, late, share, J, a, posture)
    L, Y, A, force = scratch_matrix(n, n), scratch_matrix(m, n), scratch_matrix(m, m), scratch(m)
    L[:], Y[:] = M, J
    if not factor(L):
        return RANK_LOST
    back_substitute_rows(L, Y)
    outer_product(J, Y, A)
    if not factor(A):
        return RANK_LOST
    if gains[YIELDS] != 0.0:
        inertia = scratch_matrix(3, 3)
        fill_held_inertia(A, inertia)
        if gains[VALVE] != 0.0 or gains[PRESS] > 0.0:
            _let_through(gains, model, inertia, seen, a)
        if not _give_way(inertia, seen.f_T, a):
            return RANK_LOST
    times(J, posture, force)
    for i in range(m):
        force[i] = a[i] - force[i]
    back_substitute(A, force)
    transposed_times(J[:3], force[:3], out[TIP])
    transposed_times(J[3:], force[3:], out[RCM])
    times(M, posture, out[JOINT])
    qddot, constant, torque, most = scratch(n), scratch(n), scratch(n), scratch(n)
    transposed_times(Y, force, qddot)
    for i in range(n):
        qddot[i] += posture[i]
        out[BIAS, i] = model.bias[i] + seen.damping[i] * model.v[i]
        out[DISTURBANCE, i] = -d[i]
        out[LIMITS, i] = 0.0
        constant[i] = out[BIAS, i] - d[i]
        most[i] = TORQUE_SHARE * seen.tau_max[i]
    times(M, qddot, torque)
    for i in range(n):
        torque[i] += constant[i]
    if allows(torque, most, qddot, seen, model.q, model.v):
        return GOES_ON
    low, high, kept = scratch(n), scratch(n), scratch(n)
    fill_acceleration_bounds(seen, model.q, model.v, low, high)
    status = prioritised(M, constant, J, a, posture, low, high, most, kept)
    if status == GOES_ON:
        for i in range(n):
            kept[i] -= qddot[i]
        times(M, kept, out[LIMITS])
    return status
