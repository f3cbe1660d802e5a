"""QP: inverse kinematics as a convex program with the RCM as a hard constraint."""

from collections.abc import Mapping
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.control.limit_avoidance import fill_avoidance
from surgsim.control.manipulability import fill_log_manipulability_gradient
from surgsim.control.planes import PlaneConfig, fill_plane_rows, plane_numbers
from surgsim.control.qp import check_package
from surgsim.control.resolvers.base import KernelResolver
from surgsim.control.resolvers.program import (
    OWN,
    Program,
    SolvedInPython,
    Solver,
    check_solver,
    examined,
    solve_warm,
)
from surgsim.control.resolvers.rows import answer, fill_braking, fill_task_rows
from surgsim.models.arm import ArmModel
from surgsim.tick.arrays import Resolved, Seen
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.status import GOES_ON, INFEASIBLE, RANK_LOST

WEIGHT, SLACK, CLIMB, SOFT, K_TIP, K_RCM, LIMITED, WALL_GAIN, WALLS = range(9)
"""Gains: w, w_s, w_mu, rows with a slack, k_tip, k_rcm, limited acceleration, walls' gain, first wall."""
_TASK_ROWS = 5


class QpConfig(PartConfig):
    """Convex QP inverse kinematics: hard RCM, soft tip, joint and workspace limits.

    Attributes:
        velocity_weight: Diagonal of W.
        slack_weight: Diagonal of W_s, the weight of the tip's slack.
        manipulability_weight: Weight of -q' . grad(ln mu); 0 is the paper's objective.
        tip: `soft` leaves the tip rows a slack, `hard` makes them equalities.
        k_tip: Tip feedback gain [1/s].
        k_rcm: K_rcm [1/s].
        acceleration_limit: Whether joint accelerations are limited too.
        planes: Virtual walls of the workspace.
        plane_gain_per_s: How fast the tip may approach a wall [1/s].
        solver: `active_set`, `daqp`, `osqp`, or another solver that qpsolvers finds installed, by its name.
    """

    type: Literal["qp"] = "qp"
    velocity_weight: PositiveFloat = 1.0
    slack_weight: PositiveFloat = 1e6
    manipulability_weight: NonNegativeFloat = 0.0
    tip: Literal["soft", "hard"] = "soft"
    k_tip: NonNegativeFloat = 5.0
    k_rcm: NonNegativeFloat = 5.0
    acceleration_limit: bool = True
    planes: tuple[PlaneConfig, ...] = ()
    plane_gain_per_s: PositiveFloat = 20.0
    solver: Annotated[str, AfterValidator(check_solver)] = OWN

    def check_installed(self) -> None:
        """Refuse a solver that is not installed.

        Raises:
            MissingPackageError: Then.
        """
        check_package(self.solver)

    def build(self, arm: ArmModel) -> KernelResolver:
        """The resolver."""
        n, soft = arm.limits.q_min.size, 3 if self.tip == "soft" else 0
        numbers = [self.velocity_weight, self.slack_weight, self.manipulability_weight, soft]
        numbers += [self.k_tip, self.k_rcm, self.acceleration_limit, self.plane_gain_per_s]
        walls = len(self.planes)

        def without_answer(seen: Seen) -> str:
            return f"QP: no joint velocity meets {3 + seen.rows} task rows, {walls} planes and the bounds"

        return KernelResolver(
            kernel=qp if self.solver == OWN else SolvedInPython(_solved_in_python, self.solver),
            arm=arm,
            gains=np.concatenate((np.array(numbers, dtype=np.float64), plane_numbers(self.planes))),
            memory_size=2 * n + soft + _TASK_ROWS + walls,
            failures={INFEASIBLE: without_answer},
            examine=_examine,
        )


@compiled
def qp(gains: Array, seen: Seen, memory: Array, out: Resolved) -> int:
    """Minimise 1/2 q'^T W q' + s^T W_s s - w q' . grad(ln mu), over joint velocities q' and slack s.

        J_T q' = v_d + s                        tip, soft (s = 0 when hard)
        J_rcm q' = -K_rcm e + N C'              RCM, hard: never relaxed
        Omega, |q' - q'_last| <= a_max T, q' able to stop before the position limit
        n . J_T q' <= gain (offset - n . p)     workspace planes

    Where the bounds of acceleration and Omega exclude each other, Omega holds. An infeasible program is the
    outcome INFEASIBLE with its matrices attached, never a silent zero. Memory: the last q', the measured one
    at first, and the sides of the last solution.

    Source: passive convex teleoperation paper, sections 1.1-1.3; `passive_qp` is the whole of it.
    """
    n = seen.q.size
    last = memory[:n]
    if seen.first != 0:
        last[:] = seen.v
    ranked, program = qp_program(gains, seen, last)
    if not ranked:
        return RANK_LOST
    x = np.empty(program[1].size)
    if not solve_warm(program, memory[n : n + x.size + program[5].size], x):
        return INFEASIBLE
    _answer(gains, seen, x, last, out)
    return GOES_ON


def _solved_in_python(solver: Solver, gains: Array, seen: Seen, memory: Array, out: Resolved) -> int:
    """The law of `qp` by another solver."""
    last = memory[: seen.q.size]
    if seen.first:
        last[:] = seen.v
    ranked, program = qp_program(gains, seen, last)
    if not ranked:
        return RANK_LOST
    x = solver(program)
    if x is None:
        return INFEASIBLE
    _answer(gains, seen, x, last, out)
    return GOES_ON


@compiled
def _answer(gains: Array, seen: Seen, x: Array, last: Array, out: Resolved) -> None:
    """The program's answer inside Omega, which is remembered."""
    m = 3 + seen.rows
    J, v = scratch_matrix(m, seen.q.size), scratch(m)
    fill_task_rows(seen, gains[K_TIP], gains[K_RCM], J, v)
    answer(seen, x[: seen.q.size], J, v, out)
    last[:] = out.qdot


@compiled
def qp_program(gains: Array, seen: Seen, last: Array) -> tuple[bool, Program]:
    """The program over (q', s) after the last joint velocity `last` (n,); False where J_T has lost rank."""
    n, soft = seen.q.size, int(gains[SOFT])
    rows, walls = 3 + seen.rows, (gains.size - WALLS) // 4
    J, v = scratch_matrix(rows, n), scratch(rows)
    fill_task_rows(seen, gains[K_TIP], gains[K_RCM], J, v)
    H, f = np.zeros((n + soft, n + soft)), np.zeros(n + soft)
    lower, upper = np.full(n + soft, -np.inf), np.full(n + soft, np.inf)
    G, low = np.zeros((rows + walls, n + soft)), np.full(rows + walls, -np.inf)
    high = np.empty(rows + walls)
    lower[:n], upper[:n] = seen.lower, seen.upper
    if gains[LIMITED] != 0.0:
        fill_braking(seen, last, lower[:n], upper[:n])
    for j in range(n + soft):
        H[j, j] = gains[WEIGHT] if j < n else 2.0 * gains[SLACK]
    ranked = True
    if gains[CLIMB] != 0.0:
        ranked = fill_log_manipulability_gradient(seen.Jv_WT, seen.z_W, f[:n])
        for j in range(n):
            f[j] *= -gains[CLIMB]
    away = scratch(n)
    if fill_avoidance(seen, False, away):
        for j in range(n):
            f[j] -= gains[WEIGHT] * away[j]
    G[:rows, :n] = J
    for i in range(soft):
        G[i, n + i] = -1.0
    low[:rows] = v
    high[:rows] = v
    fill_plane_rows(gains[WALLS:], gains[WALL_GAIN], seen, G[rows:], high[rows:])
    return ranked, (H, f, lower, upper, G, low, high)


def _examine(gains: Array, seen: Seen, memory: Array) -> Mapping[str, Array]:
    return examined(qp_program(gains, seen, memory[: seen.q.size])[1])
