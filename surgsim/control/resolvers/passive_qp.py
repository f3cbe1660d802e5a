"""Passive QP: the remote side of passive convex teleoperation, with an energy budget as a row."""

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import AfterValidator, Field, NonNegativeFloat, PositiveFloat, model_validator

from surgsim.array import Array
from surgsim.catalog import ADDED, PartConfig
from surgsim.columns import Block, scalar, vector
from surgsim.compiled import compiled
from surgsim.control.limit_avoidance import fill_avoidance
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
from surgsim.control.resolvers.rows import fill_braking, fill_roll_row
from surgsim.control.tip_energy import affordable_speed, fill_tip_inertia
from surgsim.models.arm import ArmModel
from surgsim.tick.algebra import dot, norm, times
from surgsim.tick.arrays import Resolved, Seen
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.status import GOES_ON, INFEASIBLE

WEIGHT, SLACK, ROLL_SLACK, K_TIP, K_RCM, SHARE, SPEED, LEAD, WALL_GAIN = range(9)
KINETIC, LAG, KINETIC_SHARE, WALLS = range(9, 13)
"""Gains: w, w_s, w_r, k_tip, k_rcm, share of the budget or 0, v_max, lead, walls' gain; whether kinetic, its
lag and share; walls."""
COLUMNS: tuple[Block, ...] = (
    vector("slack", "m_per_s"),
    scalar("slack_roll", "rad_per_s"),
    scalar("passivity_active"),
    scalar("planes_active"),
    scalar("qp_relaxed"),
)
_BUDGET, _WALLS, _RELAXED = 4, 5, 6  # places of the values after the slacks
_SLACKS = 4
_TASK_ROWS = 10  # tip, roll, RCM, budget, speed
_ACTIVE = 1e-9
_WHOLE = 0.999  # a scale that comes back to 1 is 1 from here on


class PassiveQpConfig(PartConfig):
    """QP of passive convex teleoperation: hard RCM, soft tip and roll, walls, and an energy budget.

    Attributes:
        velocity_weight: Diagonal of W.
        slack_weight: Weight of the slack of the tip's velocity, of W_s.
        roll_slack_weight: Weight of the slack of the roll about the shaft, of W_s.
        k_tip: Feedback of the tip's position [1/s]; 0, as in the paper, follows the commanded velocity alone.
        k_rcm: K_rcm [1/s].
        passivity: Whether the energy budget is a row.
        kinetic: Whether the commanded velocity is scaled so that the budget covers its kinetic energy.
        kinetic_lag_s: Time constant of that scale [s]; one that follows every change of the budget excites
            elastic drives, and one that lags does not cover every instant. It needs `kinetic`.
        kinetic_share: Share of the budget that the command's kinetic energy may have; it needs `kinetic`.
        budget_share: Share of the tank's budget that one period may spend; 1 is the paper's.
        planes: Virtual walls of the workspace.
        plane_gain_per_s: How fast the tip may approach a wall [1/s].
        tip_speed_max_m_per_s: Limit of the commanded tip speed along each axis, taken up by the slack [m/s].
        lead_max_m: How far the integrated tip reference may lead the measured tip [m].
        solver: `active_set`, `daqp`, `osqp`, or another solver that qpsolvers finds installed, by its name.
    """

    follows_roll: ClassVar[bool] = True
    type: Literal["passive_qp"] = "passive_qp"
    velocity_weight: PositiveFloat = 1.0
    slack_weight: PositiveFloat = 1e6
    roll_slack_weight: PositiveFloat = 1e2
    k_tip: NonNegativeFloat = 0.0
    k_rcm: NonNegativeFloat = 5.0
    passivity: bool = True
    kinetic: bool = False
    kinetic_lag_s: Annotated[NonNegativeFloat, ADDED] = 0.0
    kinetic_share: Annotated[float, Field(gt=0.0, le=1.0), ADDED] = 1.0
    budget_share: Annotated[float, Field(gt=0.0, le=1.0)] = 1.0
    planes: tuple[PlaneConfig, ...] = ()
    plane_gain_per_s: PositiveFloat = 20.0
    tip_speed_max_m_per_s: PositiveFloat = 0.25
    lead_max_m: PositiveFloat = 0.001
    solver: Annotated[str, AfterValidator(check_solver)] = OWN

    @model_validator(mode="after")
    def _is_scaled(self) -> Self:
        for key, nothing in (("kinetic_lag_s", 0.0), ("kinetic_share", 1.0)):
            if not self.kinetic and getattr(self, key) != nothing:
                raise ValueError(f"{key} needs kinetic: true, or nothing is scaled")
        return self

    def check_installed(self) -> None:
        """Refuse a solver that is not installed.

        Raises:
            MissingPackageError: Then.
        """
        check_package(self.solver)

    def build(self, arm: ArmModel) -> KernelResolver:
        """The resolver."""
        n, walls = arm.limits.q_min.size, len(self.planes)
        numbers = [self.velocity_weight, self.slack_weight, self.roll_slack_weight, self.k_tip, self.k_rcm]
        numbers += [self.budget_share * self.passivity, self.tip_speed_max_m_per_s, self.lead_max_m]
        numbers += [self.plane_gain_per_s, self.kinetic, self.kinetic_lag_s, self.kinetic_share]
        text = f"QP: no joint velocity meets the RCM, {walls} planes, the energy budget and the bounds"
        return KernelResolver(
            kernel=passive_qp if self.solver == OWN else SolvedInPython(_solved_in_python, self.solver),
            arm=arm,
            gains=np.concatenate((np.array(numbers, dtype=np.float64), plane_numbers(self.planes))),
            memory_size=2 * n + 7 + _SLACKS + _TASK_ROWS + walls,
            columns=COLUMNS,
            failures={INFEASIBLE: text},
            examine=_examine,
        )


@compiled
def passive_qp(gains: Array, seen: Seen, memory: Array, out: Resolved) -> int:
    """Minimise 1/2 q'^T W q' + s^T W_s s  over joint velocities q' and the slack s (4,).

        J_rcm q' = -K_rcm e + N C'                       RCM, hard: no slack
        J_T q'   = v_d + s_1..3,  d . J_w q' = w_d + s_4   tip and roll, soft
        T h_e . J_T q' <= share (T(x_t) - epsilon)       passivity: what the tip gives the surroundings
        Omega, |q' - q'_last| <= a_max T, able to stop before the position limit
        n . J_T q' <= gain (offset - n . p)              walls;   |J_T q'| <= v_max along each axis

    h_e is the force on the surroundings, the opposite of the measured one. The budget comes with the command
    (`TipCommand.budget`); without one the row is void. An emptied tank allows no more extraction, and never
    asks for motion that refills it. Where bounds of acceleration make the program infeasible, it is solved
    once more without them, and `qp_relaxed` says so; if there is still no answer the outcome is INFEASIBLE.

    That row covers what the tip gives away at the force of now, not the motion that an impact stops. With
    `kinetic` the command is scaled before,

        v_d := s v_d,   lag s' = min(1, sqrt(2 share (T - epsilon) / v_d' L v_d)) - s

    with the tip's inertia L (RCM held): no row, so that no bound has to give way to it. That is ours.

    The torque law follows the resolved motion: J_T q' and its integral, which may lead the measured tip by
    `lead_max_m`. The instrument has no wrist, so of the paper's angular rows the roll is the one left free by
    the RCM.

    Memory: the last q' (n,), its tip velocity (3,), the tip reference integrated from it (3,), the sides of
    the last solution, and the scale s.

    Source: passive convex teleoperation paper, sections 1.1-1.4.
    """
    n = seen.q.size
    _begin(seen, memory)
    _scale_command(gains, seen, memory)
    sides, x, relaxed = memory[n + 6 : -1], np.empty(n + _SLACKS), 0.0
    program = passive_program(gains, seen, memory, True)
    sides = sides[: x.size + program[5].size]
    if not solve_warm(program, sides, x):
        program, relaxed = passive_program(gains, seen, memory, False), 1.0
        if not solve_warm(program, sides, x):
            return INFEASIBLE
    _answer(gains, seen, program, x, relaxed, memory, out)
    return GOES_ON


def _solved_in_python(solver: Solver, gains: Array, seen: Seen, memory: Array, out: Resolved) -> int:
    """The law of `passive_qp` by another solver."""
    _begin(seen, memory)
    _scale_command(gains, seen, memory)
    program, relaxed = passive_program(gains, seen, memory, True), 0.0
    x = solver(program)
    if x is None:
        program, relaxed = passive_program(gains, seen, memory, False), 1.0
        x = solver(program)
    if x is None:
        return INFEASIBLE
    _answer(gains, seen, program, x, relaxed, memory, out)
    return GOES_ON


@compiled
def _covered(gains: Array, seen: Seen) -> float:
    """Share of the commanded velocity whose kinetic energy the budget covers."""
    if gains[KINETIC] == 0.0 or not math.isfinite(seen.budget_j):
        return 1.0
    inertia = scratch_matrix(3, 3)
    if not fill_tip_inertia(seen, inertia):
        return 0.0
    return affordable_speed(inertia, seen.v_WTd, gains[KINETIC_SHARE] * seen.budget_j)


@compiled
def _begin(seen: Seen, memory: Array) -> None:
    """The memory before the first tick: the measured motion, and a command that is not scaled."""
    n = seen.q.size
    if seen.first != 0:
        memory[:n] = seen.v
        times(seen.Jv_WT, seen.v, memory[n : n + 3])
        memory[n + 3 : n + 6] = seen.p_WT
        memory[-1] = 1.0


@compiled
def _scale_command(gains: Array, seen: Seen, memory: Array) -> None:
    """Move the command's scale towards what the budget covers."""
    covered = _covered(gains, seen)
    if gains[LAG] <= seen.dt_s:
        memory[-1] = covered
        return
    memory[-1] += (covered - memory[-1]) * seen.dt_s / gains[LAG]
    if covered == 1.0 and memory[-1] > _WHOLE:
        memory[-1] = 1.0


@compiled
def passive_program(gains: Array, seen: Seen, memory: Array, braking: bool) -> Program:
    """The program over (q', s), with the bounds of acceleration or without them.

    Rows: tip, roll, shaft, budget, walls, speed.
    """
    n, m, walls = seen.q.size, seen.rows, (gains.size - WALLS) // 4
    rows, size = 8 + m + walls, n + _SLACKS
    H, f = np.zeros((size, size)), np.zeros(size)
    lower, upper = np.full(size, -np.inf), np.full(size, np.inf)
    G, low, high = np.zeros((rows, size)), np.full(rows, -np.inf), np.empty(rows)
    lower[:n], upper[:n] = seen.lower, seen.upper
    if braking:
        fill_braking(seen, memory[:n], lower[:n], upper[:n])
    for j in range(size):
        H[j, j] = gains[WEIGHT] if j < n else 2.0 * gains[SLACK if j < size - 1 else ROLL_SLACK]
    away = scratch(n)
    if fill_avoidance(seen, True, away):
        for j in range(n):
            f[j] = -gains[WEIGHT] * away[j]
    share = memory[-1]
    for i in range(3):
        G[i, :n] = seen.Jv_WT[i]
        low[i] = high[i] = share * seen.v_WTd[i] - gains[K_TIP] * (seen.p_WT[i] - seen.p_WTd[i])
        G[rows - 3 + i, :n] = seen.Jv_WT[i]
        low[rows - 3 + i], high[rows - 3 + i] = -gains[SPEED], gains[SPEED]
    fill_roll_row(seen, G[3, :n])
    low[3] = high[3] = seen.roll_rate
    for i in range(_SLACKS):
        G[i, n + i] = -1.0
    for i in range(m):
        G[4 + i, :n] = seen.J_rcm[i]
        low[4 + i] = high[4 + i] = seen.rcm_velocity[i] - gains[K_RCM] * seen.rcm_error[i]
    high[4 + m] = np.inf
    if gains[SHARE] > 0.0 and math.isfinite(seen.budget_j):
        high[4 + m] = gains[SHARE] * max(seen.budget_j, 0.0) / seen.dt_s
        for j in range(n):
            for i in range(3):
                G[4 + m, j] -= seen.budget_f_T[i] * seen.Jv_WT[i, j]
    fill_plane_rows(gains[WALLS:], gains[WALL_GAIN], seen, G[5 + m :], high[5 + m : 5 + m + walls])
    return H, f, lower, upper, G, low, high


@compiled
def _answer(
    gains: Array, seen: Seen, program: Program, x: Array, relaxed: float, memory: Array, out: Resolved
) -> None:
    """The answer inside Omega, the motion that the torque law follows, the columns' values, the memory.

    The row of the energy budget and those of the walls are active where they are at their bound; the budget
    also where the command is scaled to it.
    """
    n = seen.q.size
    G, most = program[4], program[6]
    last, v_T, p_Td = memory[:n], memory[n : n + 3], memory[n + 3 : n + 6]
    for j in range(n):
        last[j] = out.qdot[j] = min(max(x[j], seen.lower[j]), seen.upper[j])
    lead = np.empty(3)
    for i in range(3):
        out.p_WTd[i], out.a_WTd[i] = p_Td[i], v_T[i]
        lead[i] = p_Td[i] - seen.p_WT[i]
    times(seen.Jv_WT, last, v_T)
    kept = gains[LEAD] / max(norm(lead), gains[LEAD])
    for i in range(3):
        out.v_WTd[i] = v_T[i]
        out.a_WTd[i] = (v_T[i] - out.a_WTd[i]) / seen.dt_s
        p_Td[i] = seen.p_WT[i] + lead[i] * kept + seen.dt_s * v_T[i]
    out.values[:_SLACKS] = x[n:]
    out.values[_BUDGET], out.values[_WALLS], out.values[_RELAXED] = 0.0, 0.0, relaxed
    budget = _SLACKS + seen.rows
    for i in range(budget, most.size - 3):
        if dot(G[i], x) >= most[i] - _ACTIVE:
            out.values[_BUDGET if i == budget else _WALLS] += 1.0
    if memory[-1] < 1.0:
        out.values[_BUDGET] = 1.0
    out.residual = norm(x[n : n + 3])


def _examine(gains: Array, seen: Seen, memory: Array) -> Mapping[str, Array]:
    return examined(passive_program(gains, seen, memory, False))
