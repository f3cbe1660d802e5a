"""The lateral force of the wall on the shaft, from joint torques or from a sensor at the flange."""

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.control.rcm import fill_rcm
from surgsim.tick.algebra import back_substitute, back_substitute_rows, cross, dot, factor, outer_product
from surgsim.tick.arrays import Seen
from surgsim.tick.scratch import scratch, scratch_matrix

LEAST_LEVER_M = 0.02
"""Shorter levers between two places of the shaft do not tell their forces apart."""


@compiled
def lateral_force(seen: Seen, d: Array, out: Array) -> bool:
    """Lateral force of the wall on the shaft, world frame (3,) [N], from a disturbance torque d (n,) [N m].

    f = (J_rcm M^-1 J_rcm^T)^-1 J_rcm M^-1 d: in the dynamically consistent sense. False where J_rcm has lost
    rank.
    """
    n = d.size
    error, J, velocity = scratch(2), scratch_matrix(2, n), scratch(2)
    N = scratch_matrix(2, 3)
    fill_rcm(
        seen.p_WS,
        seen.R_WT,
        seen.Jv_WS,
        seen.Jw_WT,
        seen.p_WC,
        seen.v_WC,
        error,
        J,
        velocity,
        N,
    )
    L, Y, A, f = scratch_matrix(n, n), scratch_matrix(2, n), scratch_matrix(2, 2), scratch(2)
    L[:], Y[:] = seen.M, J
    if not factor(L):
        return False
    back_substitute_rows(L, Y)
    outer_product(Y, J, A)
    if not factor(A):
        return False
    f[0], f[1] = dot(Y[0], d), dot(Y[1], d)
    back_substitute(A, f)
    for i in range(3):
        out[i] = N[0, i] * f[0] + N[1, i] * f[1]
    return True


@compiled
def split_wrench(seen: Seen, other_m: float, port: Array, other: Array) -> bool:
    """Lateral forces on the shaft at the port and at another place, from the wrench at the flange.

    With f and m about the shaft's end, its depth s below the port, and the other place l above it,

        N f = f_C + f_l,   z x m = s f_C + l f_l,   N = I - z z^T
        f_C = (l N f - z x m) / (l - s),   f_l = N f - f_C

    The sensor's moment is about the tip. Of an angled tip it is carried to the shaft's end, unless the other
    place is the tip itself: then it stays, since what acts there has no moment about it.

    Args:
        seen: The wrench, the tip, the shaft's end and the port.
        other_m: l [m]; 0 is the tip itself.
        port: Filled with f_C (3,) [N], world frame.
        other: Filled with f_l (3,) [N].

    Returns:
        False where the places are too near to each other; both are zeros then.
    """
    z, turned, moment, place, offset = scratch(3), scratch(3), scratch(3), scratch(3), scratch(3)
    place[:] = seen.p_WT
    moment[:] = seen.m_S
    if other_m > 0.0:
        for i in range(3):
            place[i], offset[i] = seen.p_WS[i], seen.p_WS[i] - seen.p_WT[i]
        cross(offset, seen.f_S, turned)
        for i in range(3):
            moment[i] -= turned[i]
    depth = along = 0.0
    for i in range(3):
        z[i] = seen.R_WT[i, 2]
        depth += z[i] * (place[i] - seen.p_WC[i])
        along += z[i] * seen.f_S[i]
        port[i] = other[i] = 0.0
    if not abs(other_m - depth) >= LEAST_LEVER_M:
        return False
    cross(z, moment, turned)
    for i in range(3):
        across = seen.f_S[i] - along * z[i]
        port[i] = (other_m * across - turned[i]) / (other_m - depth)
        other[i] = across - port[i]
    return True
