"""Rows that every resolver asks for, and what becomes of its answer."""

import math

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.control.bounds import fill_braking_bounds
from surgsim.tick.arrays import Resolved, Seen


@compiled
def fill_task_rows(seen: Seen, k_tip: float, k_rcm: float, J: Array, v: Array) -> None:
    """Rows [J_T; J_rcm] (5, n) and right side [v_d; v_rcm] (5,), eq. (20) of the VPRNN paper.

    v_d = -k1 (p - p_d) + p_d', v_rcm = -k2 e + N C'. The first three, of the tip, alone, where J and v have
    no room for more.
    """
    for i in range(3):
        J[i] = seen.Jv_WT[i]
        v[i] = seen.v_WTd[i] - k_tip * (seen.p_WT[i] - seen.p_WTd[i])
    for i in range(v.size - 3):
        J[3 + i] = seen.J_rcm[i]
        v[3 + i] = seen.rcm_velocity[i] - k_rcm * seen.rcm_error[i]


@compiled
def fill_roll_row(seen: Seen, row: Array) -> None:
    """Row d . J_w (n,) of the roll about the shaft, d the shaft's axis."""
    for j in range(row.size):
        row[j] = 0.0
        for i in range(3):
            row[j] += seen.R_WT[i, 2] * seen.Jw_WT[i, j]


@compiled
def answer(seen: Seen, qdot: Array, J: Array, v: Array, out: Resolved) -> None:
    """`qdot` (n,) projected on Omega, with the residual that this leaves in J q' = v."""
    total = 0.0
    for j in range(qdot.size):
        out.qdot[j] = min(max(qdot[j], seen.lower[j]), seen.upper[j])
    for i in range(J.shape[0]):
        row = -v[i]
        for j in range(qdot.size):
            row += J[i, j] * out.qdot[j]
        total += row * row
    out.residual = math.sqrt(total)


@compiled
def fill_braking(seen: Seen, last: Array, low: Array, high: Array) -> None:
    """Omega with acceleration limits after the last joint velocity `last` (n,), see `fill_braking_bounds`."""
    fill_braking_bounds(
        seen.q,
        last,
        seen.lower,
        seen.upper,
        seen.q_min,
        seen.q_max,
        seen.a_max,
        seen.omega_gain,
        seen.dt_s,
        low,
        high,
    )
