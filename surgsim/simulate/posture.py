"""The start near a posture, by damped steps of differential inverse kinematics.

With the screw (e_v, J_v) from the tip to its place (`surgsim.simulate.screw`) and the posture q*, a step dq
minimises

    |e_v + J_v dq|^2 + |1e-4 (q + dq - q*)|^2 + 1e-9 |dq|^2

inside the joint limits, with the shaft through the trocar as a hard constraint. The weak pull of the posture
picks one of the redundant solutions.
"""

import daqp
import numpy as np

from surgsim.array import Array
from surgsim.control.rcm import rcm_kinematics
from surgsim.simulate.reach import LIMIT_MARGIN_RAD, Reach
from surgsim.simulate.screw import tip_error

_TIP_M, _RCM_M = 1e-6, 1e-6
_TURNS_RAD = (0.0, 0.5, -0.5, 1.0, -1.0, 1.5, -1.5)
_LONGEST_STEP_RAD = 0.3
_PULL, _DAMPING = 1e-4, 1e-9
_ROOM_TAKEN = 0.95
"""How much of the room to a joint limit a step may take."""
_ACTIVE_EQUALITY = 5
_UNBOUNDED = -1e30


def near_posture(reach: Reach, p_WT: Array, posture: Array) -> Array | None:
    """Joint positions (n,) [rad] near `posture` with the tip at `p_WT` (3,) [m]; None if none are found.

    Tries the posture and then turned copies of it.
    """
    for turn in _TURNS_RAD:
        guess = posture.copy()
        guess[0] += turn
        q = _solved(reach, p_WT, guess, posture, 200)
        tip, rcm = reach.miss(q, p_WT)
        if _TIP_M <= tip < 1e-4:  # the posture's pull is left
            q = _solved(reach, p_WT, q, q, 50)
            tip, rcm = reach.miss(q, p_WT)
        if tip < _TIP_M and rcm < _RCM_M:
            return q
    return None


def _solved(reach: Reach, p_WT: Array, q: Array, posture: Array, most: int) -> Array:
    """Joint positions (n,) [rad] near `q` whose tip is at `p_WT` (3,) [m], by at most so many steps.

    The trocar is one more aim in a step in which it cannot be met inside the joint limits, so the result must
    be checked with `Reach.miss`.
    """
    low, high = reach.arm.limits.q_min + LIMIT_MARGIN_RAD, reach.arm.limits.q_max - LIMIT_MARGIN_RAD
    q = np.clip(q, low, high)
    for count in range(most):
        step = _step(reach, p_WT, q, posture, hard=True)
        if step is None:
            step = _step(reach, p_WT, q, posture, hard=False)
        if step is None:  # too far away for the solver: what is there will miss
            break
        length = float(np.linalg.norm(step))
        q = q + step * min(1.0, _LONGEST_STEP_RAD / max(length, 1e-12))
        if count >= 1 and max(reach.miss(q, p_WT)) < 1e-9:
            break
    return np.asarray(np.clip(q, low, high))


def _step(reach: Reach, p_WT: Array, q: Array, posture: Array, *, hard: bool) -> Array | None:
    """The step (n,) [rad] at `q`; None if there is none inside the limits, `hard` on the trocar too."""
    kin, n = reach.arm.kinematics(q), q.size
    limits = reach.arm.limits
    error, jacobian = tip_error(p_WT, kin.p_WT, kin.R_WT, kin.Jv_WT, kin.Jw_WT)
    rows, aims = [jacobian, _PULL * np.eye(n)], [-error, _PULL * (posture - q)]
    held, held_aim = np.zeros((0, n)), np.zeros(0)
    if reach.p_WC is not None:
        rcm = rcm_kinematics(kin, reach.p_WC, np.zeros(3))
        if hard:
            held, held_aim = rcm.jacobian, -rcm.error
        else:
            rows.append(rcm.jacobian)
            aims.append(-rcm.error)
    W = np.vstack(rows)
    H = W.T @ W
    H.flat[:: n + 1] += _DAMPING
    above = _ROOM_TAKEN * (limits.q_max - LIMIT_MARGIN_RAD - q)
    below = _ROOM_TAKEN * (q - limits.q_min - LIMIT_MARGIN_RAD)
    upper = np.concatenate((above, below, held_aim))
    sense = np.zeros(upper.size, dtype=np.int32)
    sense[2 * n :] = _ACTIVE_EQUALITY
    constraints = np.vstack((np.eye(n), -np.eye(n), held))
    aim = -(np.concatenate(aims) @ W)
    x, _, exit_flag, _ = daqp.solve(H, aim, constraints, upper, np.full(upper.size, _UNBOUNDED), sense)
    return np.array(x) if exit_flag > 0 else None
