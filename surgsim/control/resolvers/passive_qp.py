"""Passive QP: the remote side of passive convex teleoperation, with an energy budget as a row."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, NonNegativeFloat, PositiveFloat

from surgsim.catalog import PartConfig
from surgsim.columns import Block, scalar, vector
from surgsim.compiled import compiled
from surgsim.control.failure import ControlFailure
from surgsim.control.planes import PlaneConfig, Planes
from surgsim.control.problem import Resolution, VelocityProblem, braking_bounds
from surgsim.control.qp import DenseQp
from surgsim.control.resolvers.qp import check_backend
from surgsim.errors import Outcome
from surgsim.models.arm import ArmModel
from surgsim.plant.state import NO_FORCE
from surgsim.tasks.base import TipCommand

Array = NDArray[np.float64]

_ACTIVE = 1e-9
_NO_SHAFT, _NO_SPEED = np.zeros((0, 7)), np.zeros(0)


class PassiveQpConfig(PartConfig):
    """QP of passive convex teleoperation: hard RCM, soft tip and roll, walls, and an energy budget.

    Attributes:
        velocity_weight: Diagonal of W.
        slack_weight: Weight of the slack of the tip's velocity, of W_s.
        roll_slack_weight: Weight of the slack of the roll about the shaft, of W_s.
        k_tip: Feedback of the tip's position [1/s]; 0, as in the paper, follows the commanded velocity alone.
        k_rcm: K_rcm [1/s].
        passivity: Whether the energy budget is a row.
        budget_share: Share of the tank's budget that one period may spend; 1 is the paper's.
        planes: Virtual walls of the workspace.
        plane_gain_per_s: How fast the tip may approach a wall [1/s].
        tip_speed_max_m_per_s: Limit of the commanded tip speed along each axis, taken up by the slack [m/s].
        lead_max_m: How far the integrated tip reference may lead the measured tip [m].
        solver: `daqp`, `osqp`, or another solver that qpsolvers finds installed, by its name.
    """

    type: Literal["passive_qp"] = "passive_qp"
    velocity_weight: PositiveFloat = 1.0
    slack_weight: PositiveFloat = 1e6
    roll_slack_weight: PositiveFloat = 1e2
    k_tip: NonNegativeFloat = 0.0
    k_rcm: NonNegativeFloat = 5.0
    passivity: bool = True
    budget_share: Annotated[float, Field(gt=0.0, le=1.0)] = 1.0
    planes: tuple[PlaneConfig, ...] = ()
    plane_gain_per_s: PositiveFloat = 20.0
    tip_speed_max_m_per_s: PositiveFloat = 0.25
    lead_max_m: PositiveFloat = 0.001
    solver: Annotated[str, AfterValidator(check_backend)] = "daqp"

    def build(self, arm: ArmModel) -> "PassiveQp":
        """The resolver."""
        return PassiveQp(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class PassiveQpMemory:
    """State of the resolver.

    Attributes:
        qdot: Last answer (7,) [rad/s].
        v_T: Its tip velocity (3,) [m/s].
        p_Td: Tip reference, integrated from the answers (3,) [m].
    """

    qdot: Array
    v_T: Array
    p_Td: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class _Program:
    """The program's matrices; see `DenseQp.solve`."""

    H: Array
    f: Array
    lower: Array
    upper: Array
    G: Array
    G_lower: Array
    G_upper: Array


class PassiveQp:
    """min 1/2 q'^T W q' + s^T W_s s  over joint velocities q' and the slack s (4,).

        J_rcm q' = -K_rcm e + N C'                       RCM, hard: no slack
        J_T q'   = v_d + s_1..3,  d . J_w q' = w_d + s_4   tip and roll, soft
        T h_e . J_T q' <= share (T(x_t) - epsilon)       passivity: what the tip gives the surroundings
        Omega, |q' - q'_last| <= a_max T, able to stop before the position limit
        n . J_T q' <= gain (offset - n . p)              walls;   |J_T q'| <= v_max along each axis

    h_e is the force on the surroundings, the opposite of the measured one. The budget comes with the command
    (`TipCommand.budget`); without one the row is void. An emptied tank allows no more extraction, and never
    asks for motion that refills it. Where bounds of acceleration make the program infeasible, it is solved
    once more without them, and `qp_relaxed` says so; if there is still no answer the outcome is INFEASIBLE.

    The torque law follows the resolved motion: J_T q' and its integral, which may lead the measured tip by
    `lead_max_m`. The instrument has no wrist, so of the paper's angular rows the roll is the one left free by
    the RCM.

    Source: passive convex teleoperation paper, sections 1.1-1.4.
    """

    columns: tuple[Block, ...] = (
        vector("slack", "m_per_s"),
        scalar("slack_roll", "rad_per_s"),
        scalar("passivity_active"),
        scalar("planes_active"),
        scalar("qp_relaxed"),
    )

    def __init__(self, config: PassiveQpConfig) -> None:
        self._c = config
        self._planes = Planes(config.planes, config.plane_gain_per_s)
        slack = [config.slack_weight] * 3 + [config.roll_slack_weight]
        self._H = np.diag([config.velocity_weight] * 7 + [2.0 * w for w in slack])
        self._f, self._free = np.zeros(11), np.full(4, np.inf)
        self._solver = DenseQp(config.solver)

    def start(self, problem: VelocityProblem) -> PassiveQpMemory:
        """The measured motion. The solver forgets its active set."""
        self._solver = DenseQp(self._c.solver)
        return PassiveQpMemory(
            qdot=problem.v.copy(), v_T=problem.kin.Jv_WT @ problem.v, p_Td=problem.kin.p_WT.copy()
        )

    def step(self, problem: VelocityProblem, memory: PassiveQpMemory) -> tuple[Resolution, PassiveQpMemory]:
        """Joint velocities for one period."""
        program = self._program(problem, *braking_bounds(problem, memory.qdot))
        x, relaxed = self._solve(program), 0.0
        if x is None:
            program, relaxed = self._program(problem, problem.lower, problem.upper), 1.0
            x = self._solve(program)
        if x is None:
            raise ControlFailure(
                Outcome.INFEASIBLE,
                f"QP: no joint velocity meets the RCM, {len(self._planes)} planes, the energy budget and the "
                "bounds",
                {name: getattr(program, name) for name in program.__slots__},
            )
        return self._answer(problem, memory, program, x, relaxed)

    def _solve(self, p: _Program) -> Array | None:
        return self._solver.solve(p.H, p.f, p.lower, p.upper, p.G, p.G_lower, p.G_upper)

    def _program(self, problem: VelocityProblem, lower: Array, upper: Array) -> _Program:
        kin, rcm, c = problem.kin, problem.rcm, self._c
        walls, room = self._planes.rows(kin)
        f_T, most = self._budget(problem)
        v_d = problem.command.v_WTd - c.k_tip * problem.tip_error
        shaft = _NO_SHAFT if rcm is None else rcm.jacobian
        v_rcm = _NO_SPEED if rcm is None else rcm.trocar_velocity - c.k_rcm * rcm.error
        G, G_lower, G_upper = _rows(
            kin.Jv_WT,
            kin.Jw_WT,
            kin.R_WT,
            shaft,
            f_T,
            walls,
            v_d,
            problem.command.roll_rate,
            v_rcm,
            most,
            room,
            c.tip_speed_max_m_per_s,
        )
        return _Program(
            H=self._H,
            f=self._f,
            lower=np.concatenate((lower, -self._free)),
            upper=np.concatenate((upper, self._free)),
            G=G,
            G_lower=G_lower,
            G_upper=G_upper,
        )

    def _budget(self, problem: VelocityProblem) -> tuple[Array, float]:
        """Force on the tip (3,) [N] and the power that it may give away [W]; infinite without a budget."""
        budget = problem.command.budget
        if budget is None or not self._c.passivity:
            return NO_FORCE, np.inf
        return budget.f_T, self._c.budget_share * max(budget.most_j, 0.0) / problem.dt_s

    def _answer(
        self, problem: VelocityProblem, memory: PassiveQpMemory, program: _Program, x: Array, relaxed: float
    ) -> tuple[Resolution, PassiveQpMemory]:
        kin, told = problem.kin, problem.command
        qdot, v_T, a_T, p_Td, residual, values = _finish(
            x,
            problem.lower,
            problem.upper,
            kin.Jv_WT,
            kin.p_WT,
            memory.v_T,
            memory.p_Td,
            problem.dt_s,
            self._c.lead_max_m,
            program.G,
            program.G_upper,
            len(self._planes),
            relaxed,
        )
        command = TipCommand(p_WTd=memory.p_Td, v_WTd=v_T, a_WTd=a_T, roll_rate=told.roll_rate, jaw=told.jaw)
        resolution = Resolution(qdot=qdot, residual=residual, command=command, values=values)
        return resolution, PassiveQpMemory(qdot=qdot, v_T=v_T, p_Td=p_Td)


@compiled
def _finish(
    x: Array,
    lower: Array,
    upper: Array,
    J: Array,
    p: Array,
    v_last: Array,
    p_Td: Array,
    dt: float,
    lead_max: float,
    G: Array,
    G_upper: Array,
    walls: int,
    relaxed: float,
) -> tuple[Array, Array, Array, Array, float, Array]:
    """Joint and tip velocity, tip acceleration, next tip reference, residual, values of the columns (7,).

    The row of the energy budget and those of the walls are active where they are at their bound.
    """
    qdot = np.minimum(np.maximum(x[:7], lower), upper)
    v_T = J @ qdot
    lead = p_Td - p
    length = max(math.sqrt(lead @ lead), lead_max)
    values = np.zeros(7)
    values[:4] = x[7:]
    budget = G.shape[0] - 4 - walls
    for i in range(budget, budget + 1 + walls):
        at = 0.0
        for j in range(11):
            at += G[i, j] * x[j]
        if at >= G_upper[i] - _ACTIVE:
            values[4 if i == budget else 5] += 1.0
    values[6] = relaxed
    residual = math.sqrt(x[7] * x[7] + x[8] * x[8] + x[9] * x[9])
    return qdot, v_T, (v_T - v_last) / dt, p + lead * (lead_max / length) + dt * v_T, residual, values


@compiled
def _rows(
    Jv: Array,
    Jw: Array,
    R: Array,
    shaft: Array,
    f_T: Array,
    walls: Array,
    v_d: Array,
    roll_rate: float,
    v_rcm: Array,
    most_w: float,
    room: Array,
    speed: float,
) -> tuple[Array, Array, Array]:
    """Rows (m + n + 8, 11) over (q', s) and their bounds: tip and roll, shaft, budget, walls, speed."""
    m, n = shaft.shape[0], walls.shape[0]
    G = np.zeros((m + n + 8, 11))
    low, high = np.full(m + n + 8, -np.inf), np.empty(m + n + 8)
    G[:3, :7] = G[m + n + 5 :, :7] = Jv
    low[:3] = high[:3] = v_d
    low[3] = high[3] = roll_rate
    low[4 : 4 + m] = high[4 : 4 + m] = v_rcm
    for j in range(7):
        for i in range(3):
            G[3, j] += R[i, 2] * Jw[i, j]
            G[4 + m, j] -= f_T[i] * Jv[i, j]
    for i in range(4):
        G[i, 7 + i] = -1.0
    G[4 : 4 + m, :7] = shaft
    high[4 + m] = most_w
    G[5 + m : 5 + m + n, :7] = walls
    high[5 + m : 5 + m + n] = room
    low[m + n + 5 :] = -speed
    high[m + n + 5 :] = speed
    return G, low, high
