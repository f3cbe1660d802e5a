"""Self-motion optimum: go to the most manipulable posture as fast as the joints allow, then stay on it."""

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, NonNegativeFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.control.manifold import (
    CLIMB_STEPS,
    CLIMB_TOLERANCE_RAD,
    PROJECTION_STEPS,
    Manifold,
    climb,
    climb_from,
    improve,
    is_inside,
    project,
)
from surgsim.control.manipulability import fill_velocity_products, manipulability
from surgsim.control.rcm import fill_rcm_bias
from surgsim.control.resolvers.base import KernelResolver
from surgsim.control.resolvers.program import solve_warm
from surgsim.control.resolvers.rows import answer, fill_braking, fill_task_rows
from surgsim.control.self_motion import MARGIN_RAD, search_offsets
from surgsim.models.arm import ArmModel
from surgsim.tick.algebra import nearest
from surgsim.tick.arrays import Resolved, Seen
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.status import GOES_ON, INFEASIBLE, RANK_LOST

K_TIP, K_RCM, SHARE, OFFSETS = range(4)
"""Gains: k_tip, k_rcm, share of the acceleration limits, and the search's first start (n,) of many."""
_HORIZON_S = 10.0
_REHEARSAL_S = 0.02
_TRACKING_STEPS, _TRACKING_RADIUS_RAD = 3, 0.05
_TASK_ROWS = 5


class SelfMotionConfig(PartConfig):
    """Tracks the self-motion optimum of the manipulability at the joints' velocity and acceleration limits.

    Attributes:
        k_tip: Tip feedback gain [1/s], at most one over the control period.
        k_rcm: RCM feedback gain [1/s].
        acceleration_share: Share of the acceleration limits that self-motion may plan with.
        search_starts: Random starts of the search for the optimum before the first step; 0 climbs from the
            start configuration alone.
    """

    needs_redundancy: ClassVar[int] = 1
    type: Literal["self_motion"] = "self_motion"
    k_tip: NonNegativeFloat = 5.0
    k_rcm: NonNegativeFloat = 5.0
    acceleration_share: Annotated[float, Field(gt=0.0, le=1.0)] = 0.9
    search_starts: Annotated[int, Field(ge=0, le=1000)] = 24

    def build(self, arm: ArmModel) -> KernelResolver:
        """The resolver."""
        n = arm.limits.q_min.size
        numbers = np.array([self.k_tip, self.k_rcm, self.acceleration_share], dtype=np.float64)
        return KernelResolver(
            kernel=self_motion,
            arm=arm,
            gains=np.concatenate((numbers, search_offsets(self.search_starts, arm).ravel())),
            memory_size=3 * n + _TASK_ROWS,
            failures={INFEASIBLE: "self-motion: no joint velocity inside Omega meets the task rows"},
            examine=_examine,
        )


@compiled
def self_motion(gains: Array, seen: Seen, memory: Array, out: Resolved) -> int:
    """Ours. Keeps an estimate z of the optimum on the self-motion manifold, and drives the arm to it.

    Each step projects z on the manifold of the coming tip position and takes one Newton step of ln(mu) there.
    The arm's null-space motion follows the straight joint-space line to z, all joints in step, at the speed
    from which the joints can still stop at z: q'_i <= sqrt((a T)^2 + 2 a d_i) - a T. The QP

        min |q' - q'_z|^2  subject to  J q' = b,  Omega,  acceleration and braking bounds

    keeps tip and RCM exact. b holds the second-order term of the step, so that a whole period of motion ends
    on the path and not on its tangent, from the last q' and once more from the one found:

        b = v_d + T/2 (a_d - J' q') - k e

    Where the bounds exclude the rows, Omega alone holds; where that does too, the outcome is INFEASIBLE. z is
    sought before the first step. Memory: z (n,), the last q' (n,), the sides of the last solution.
    """
    n, m = seen.q.size, 3 + seen.rows
    z, last, sides = memory[:n], memory[n : 2 * n], memory[2 * n : 3 * n + m]
    if seen.first != 0:
        last[:] = seen.v
        if not _search(gains, seen, z):
            return RANK_LOST
    goal, wanted = scratch(n), scratch(n)
    goal[:] = z
    if not _track(seen, goal):
        return RANK_LOST
    J, v = scratch_matrix(m, n), scratch(m)
    fill_task_rows(seen, gains[K_TIP], gains[K_RCM], J, v)
    if not _head_for(gains, seen, J, goal, z, wanted):
        return RANK_LOST
    low, high, qdot, b = scratch(n), scratch(n), scratch(n), scratch(m)
    qdot[:] = last
    fill_braking(seen, last, low, high)
    for _ in range(2):
        _second_order(seen, v, qdot, b)
        if not nearest(J, b, wanted, qdot):
            return RANK_LOST
        if (
            not _is_between(low, qdot, high)
            and not _solve(J, b, wanted, low, high, sides, qdot)
            and not _solve(J, b, wanted, seen.lower, seen.upper, sides, qdot)
        ):
            return INFEASIBLE
    z[:] = goal
    last[:] = qdot
    answer(seen, qdot, J, b, out)
    return GOES_ON


@compiled
def _manifold(seen: Seen, p_WT: Array) -> Manifold:
    """The manifold of a tip position, inside the joint limits and a margin."""
    n = seen.q.size
    low, high, tip, port = np.empty(n), np.empty(n), np.empty(3), np.empty(3)
    for j in range(n):
        low[j], high[j] = seen.q_min[j] + MARGIN_RAD, seen.q_max[j] - MARGIN_RAD
    tip[:], port[:] = p_WT, seen.p_WC
    return Manifold(3 + seen.rows, tip, port, low, high)


@compiled
def _track(seen: Seen, z: Array) -> bool:
    """Z (n,) becomes the optimum for the tip position at the end of this step."""
    T, p, step = seen.dt_s, scratch(3), scratch(z.size)
    for i in range(3):
        p[i] = seen.p_WTd[i] + T * seen.v_WTd[i] + 0.5 * T * T * seen.a_WTd[i]
    on, model = _manifold(seen, p), seen.elsewhere
    ranked, _ = project(model, on, z, _TRACKING_STEPS)
    if not ranked or not improve(model, on, z, _TRACKING_RADIUS_RAD, step):
        return False
    for j in range(z.size):
        z[j] += step[j]
    return True


@compiled
def _head_for(gains: Array, seen: Seen, J: Array, goal: Array, z: Array, wanted: Array) -> bool:
    """`wanted` (n,) [rad/s]: the velocity along the line to the goal, and the goal's own since it was z.

    Slowed where following the manifold's curvature at that speed would take more than the share of the
    joints' acceleration.
    """
    n, m = goal.size, J.shape[0]
    way, a, turn, at_rest = scratch(n), scratch(n), scratch(n), scratch(n)
    at_rest[:] = 0.0
    for j in range(n):
        way[j] = goal[j] - seen.q[j]
        a[j] = gains[SHARE] * seen.a_max[j]
    _approach(way, a, seen.v_max, seen.dt_s)
    bend = scratch(m)
    _fill_bend(seen, way, bend)
    if not nearest(J, bend, at_rest, turn):
        return False
    worst = 1.0
    for j in range(n):
        worst = max(worst, abs(turn[j]) / a[j])
    for j in range(n):
        wanted[j] = way[j] / math.sqrt(worst) + (goal[j] - z[j]) / seen.dt_s
    return True


@compiled
def _fill_bend(seen: Seen, qdot: Array, bend: Array) -> None:
    """Fill -J' q' of the rows (m,) [m/s^2]: what joint acceleration has to make up for at q' (n,)."""
    linear, angular, of_end = scratch(3), scratch(3), scratch(3)
    fill_velocity_products(seen.Jv_WT, seen.z_W, qdot, linear, angular)
    if bend.size > 3:
        of_end[:] = linear
        if seen.elsewhere.angled:
            fill_velocity_products(seen.Jv_WS, seen.z_W, qdot, of_end, angular)
        shaft, p, R, Jv, Jw = bend[3:], seen.p_WS, seen.R_WT, seen.Jv_WS, seen.Jw_WT
        fill_rcm_bias(p, R, Jv, Jw, qdot, seen.p_WC, seen.v_WC, of_end, angular, shaft)
    bend[:3] = linear
    for i in range(bend.size):
        bend[i] = -bend[i]


@compiled
def _second_order(seen: Seen, v: Array, qdot: Array, b: Array) -> None:
    """Fill b (m,) [m/s] = v + T/2 (a_d - J' q'): the rows' velocity for a period that ends on the path."""
    _fill_bend(seen, qdot, b)
    for i in range(3):
        b[i] += seen.a_WTd[i]
    for i in range(b.size):
        b[i] = v[i] + 0.5 * seen.dt_s * b[i]


@compiled
def _is_between(low: Array, qdot: Array, high: Array) -> bool:
    between = True
    for j in range(qdot.size):
        between = between and low[j] <= qdot[j] <= high[j]
    return between


@compiled
def _solve(J: Array, b: Array, wanted: Array, low: Array, high: Array, sides: Array, qdot: Array) -> bool:
    """The QP; `qdot` (n,) is filled. False where the bounds exclude the rows."""
    return solve_warm((np.eye(qdot.size), -wanted, low, high, J, b, b), sides, qdot)


@compiled
def _search(gains: Array, seen: Seen, z: Array) -> bool:
    """Fill z (n,): among the optima that can be reached, the one of the largest gain, the way there included.

    False where the arm is singular.
    """
    n = z.size
    on, model = _manifold(seen, seen.p_WTd), seen.elsewhere
    here, goal = scratch(n), scratch(n)
    here[:] = seen.q
    if not project(model, on, here, PROJECTION_STEPS)[0]:
        return False
    mu, most = manipulability(model.Jv_WT), 0.0
    z[:] = here
    for k in range(-1, (gains.size - OFFSETS) // n):
        if k < 0:
            goal[:] = here
            ranked, miss, height = climb(model, on, goal, CLIMB_STEPS, CLIMB_TOLERANCE_RAD)
            if not ranked:
                return False
            counts = is_inside(on, goal, miss)
        else:
            start = OFFSETS + k * n
            counts, miss, height = climb_from(model, on, here, mu, gains[start : start + n], goal)
        if counts:
            gain = _rehearse(gains[SHARE], seen, on, here, mu, goal, height)
            if gain > most:
                most = gain
                z[:] = goal
    return True


@compiled
def _rehearse(
    share: float, seen: Seen, on: Manifold, here: Array, mu: float, goal: Array, height: float
) -> float:
    """Integral of the gain in mu [s] over the next ten seconds, on the way from `here` to `goal` and there.

    Args:
        share: Share of the acceleration limits.
        seen: Limits, and the model to go with.
        on: The manifold.
        here: (n,) [rad].
        mu: Manipulability there.
        goal: (n,) [rad].
        height: Manipulability there.
    """
    n, gain, last = here.size, 0.0, 0.0
    q, way, a = scratch(n), scratch(n), scratch(n)
    q[:] = here
    for j in range(n):
        a[j] = share * seen.a_max[j]
    for k in range(round(_HORIZON_S / _REHEARSAL_S)):
        for j in range(n):
            way[j] = goal[j] - q[j]
        _approach(way, a, seen.v_max, _REHEARSAL_S)
        speed = left = 0.0
        for j in range(n):
            speed = max(speed, abs(way[j]) / a[j])
        last = min(speed, last + _REHEARSAL_S)
        for j in range(n):
            q[j] += way[j] * (_REHEARSAL_S * last / max(speed, 1e-12))
        ranked, _ = project(seen.elsewhere, on, q, 3)
        if not ranked:
            return 0.0
        gain += (manipulability(seen.elsewhere.Jv_WT) - mu) * _REHEARSAL_S
        for j in range(n):
            left = max(left, abs(goal[j] - q[j]))
        if left < 0.02:
            return gain + (height - mu) * (_HORIZON_S - (k + 1) * _REHEARSAL_S)
    return gain


@compiled
def _approach(way: Array, a: Array, v_max: Array, dt: float) -> None:
    """`way` (n,) [rad] becomes the velocity along it at which every joint can still stop at its end."""
    scale = math.inf
    for i in range(way.size):
        d = abs(way[i])
        if d > 1e-12:
            reach = a[i] * dt
            speed = min(v_max[i], math.sqrt(reach * reach + 2.0 * a[i] * d) - reach, d / dt)
            scale = min(scale, speed / d)
    for i in range(way.size):
        way[i] *= scale if scale < math.inf else 0.0


def _examine(gains: Array, seen: Seen, memory: Array) -> Mapping[str, Array]:
    n, m = seen.q.size, 3 + seen.rows
    J, v, b = np.empty((m, n)), np.empty(m), np.empty(m)
    fill_task_rows(seen, gains[K_TIP], gains[K_RCM], J, v)
    _second_order(seen, v, memory[n : 2 * n], b)
    return {"J": J, "rhs": b, "lower": seen.lower.copy(), "upper": seen.upper.copy()}
