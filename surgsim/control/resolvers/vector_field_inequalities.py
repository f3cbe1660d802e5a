"""Vector-field inequalities: the shaft inside a sphere about the port, as a row of a quadratic program."""

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import AfterValidator, Field, NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.columns import Block, scalar
from surgsim.compiled import compiled
from surgsim.control.barriers import entry_curvature
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
from surgsim.control.zones import ZoneConfig, fill_entry_row, fill_zone_rows, zone_numbers
from surgsim.models.arm import ArmModel
from surgsim.tick.algebra import cross, dot, norm
from surgsim.tick.arrays import Resolved, Seen
from surgsim.tick.scratch import scratch
from surgsim.tick.status import GOES_ON, INFEASIBLE

RADIUS, ETA, ALPHA, DAMPING, GAIN, SAMPLED, WALL_GAIN, WALLS = range(8)
"""Places of the gains; the last is the number of walls, after which come the walls and the zones."""
NUMBERS = 8
COLUMNS: tuple[Block, ...] = (scalar("entry_active"), scalar("zones_active"))
_NEAR = 1e-9


class VectorFieldInequalitiesConfig(PartConfig):
    """Soft tip and shaft direction, the port's sphere and other virtual fixtures as hard rows.

    Attributes:
        entry_radius_m: R, the radius of the sphere about the port that the shaft passes through [m].
        eta_per_s: How fast the surface of sphere or zone may be approached [1/s].
        sampled: Whether what D gains over a period by its curvature is taken off the bound; not in the paper.
        alpha: Weight of the tip; that of the shaft's direction is 1 - alpha.
        damping: lambda, the square of which is the weight of the joint velocities.
        gain_per_s: Feedback of tip and direction [1/s].
        planes: Virtual walls of the workspace.
        plane_gain_per_s: How fast the tip may approach a wall [1/s].
        zones: Spheres and cylinders that the shaft's line or the tip stays in or out of.
        solver: `active_set`, `daqp`, `osqp`, or another solver that qpsolvers finds installed, by its name.
    """

    follows_roll: ClassVar[bool] = True
    type: Literal["vector_field_inequalities"] = "vector_field_inequalities"
    entry_radius_m: PositiveFloat = 0.0005
    eta_per_s: PositiveFloat = 2.0
    sampled: bool = True
    alpha: Annotated[float, Field(gt=0.0, le=1.0)] = 0.999
    damping: PositiveFloat = 0.01
    gain_per_s: NonNegativeFloat = 20.0
    planes: tuple[PlaneConfig, ...] = ()
    plane_gain_per_s: PositiveFloat = 20.0
    zones: tuple[ZoneConfig, ...] = ()
    solver: Annotated[str, AfterValidator(check_solver)] = OWN

    def check_installed(self) -> None:
        """Refuse a solver that is not installed.

        Raises:
            MissingPackageError: Then.
        """
        check_package(self.solver)

    def build(self, arm: ArmModel) -> KernelResolver:
        """The resolver; memory: the last q' (n,), sides of the last program."""
        n, walls = arm.limits.q_min.size, len(self.planes)
        own = (
            self.entry_radius_m,
            self.eta_per_s,
            self.alpha,
            self.damping,
            self.gain_per_s,
            self.sampled,
            self.plane_gain_per_s,
            walls,
        )
        gains = np.concatenate((own, plane_numbers(self.planes), zone_numbers(self.zones)), dtype=np.float64)
        rows = f"the sphere about the port, {walls} planes, {len(self.zones)} zones and the bounds"
        return KernelResolver(
            kernel=vector_field_inequalities
            if self.solver == OWN
            else SolvedInPython(_solved_in_python, self.solver),
            arm=arm,
            gains=gains,
            memory_size=2 * n + 1 + walls + len(self.zones),
            columns=COLUMNS,
            failures={INFEASIBLE: f"QP: no joint velocity meets {rows}"},
            examine=_examine,
        )


@compiled
def _fill_objective(gains: Array, seen: Seen, H: Array, f: Array) -> None:
    """H (n, n) and f (n,) of the objective."""
    n, gain, alpha = f.size, gains[GAIN], gains[ALPHA]
    turn, wanted = scratch(3), scratch(3)
    _fill_turn(gain, seen, turn)
    for i in range(3):
        wanted[i] = seen.v_WTd[i] - gain * (seen.p_WT[i] - seen.p_WTd[i])
    for j in range(n):
        s = 0.0
        for i in range(3):
            s -= alpha * seen.Jv_WT[i, j] * wanted[i] + (1.0 - alpha) * seen.Jw_WT[i, j] * turn[i]
        f[j] = s
        for k in range(n):
            s = gains[DAMPING] * gains[DAMPING] if j == k else 0.0
            for i in range(3):
                s += alpha * seen.Jv_WT[i, j] * seen.Jv_WT[i, k]
                s += (1.0 - alpha) * seen.Jw_WT[i, j] * seen.Jw_WT[i, k]
            H[j, k] = s
    away = scratch(n)
    if fill_avoidance(seen, True, away):
        for j in range(n):
            f[j] -= gains[DAMPING] * gains[DAMPING] * away[j]


@compiled
def _fill_turn(gain: float, seen: Seen, turn: Array) -> None:
    """Angular velocity (3,) [rad/s] that points the shaft from the port to the commanded tip, with the roll.

    Without a port, or with the commanded tip in it, the roll alone.
    """
    z, towards, moved, across = scratch(3), scratch(3), scratch(3), scratch(3)
    for i in range(3):
        z[i], turn[i] = seen.R_WT[i, 2], seen.roll_rate * seen.R_WT[i, 2]
        towards[i] = seen.p_WTd[i] - seen.p_WC[i]
    if seen.rows == 0:
        return
    length = norm(towards)
    if not length > _NEAR:
        return
    for i in range(3):
        towards[i] /= length
        moved[i] = (seen.v_WTd[i] - seen.v_WC[i]) / length
    cross(z, towards, across)
    for i in range(3):
        turn[i] += gain * across[i]
    cross(towards, moved, across)
    for i in range(3):
        turn[i] += across[i]


@compiled
def vfi_program(gains: Array, seen: Seen, last: Array) -> Program:
    """The program over q', after the last joint velocity `last` (n,)."""
    n, walls, sphere = seen.q.size, int(gains[WALLS]), 1 if seen.rows > 0 else 0
    planes, zones = gains[NUMBERS : NUMBERS + 4 * walls], gains[NUMBERS + 4 * walls :]
    rows = sphere + walls + zones.size // 10
    H, f, G = np.empty((n, n)), np.empty(n), np.zeros((rows, n))
    low, high = np.full(rows, -np.inf), np.empty(rows)
    _fill_objective(gains, seen, H, f)
    if sphere:
        high[0] = fill_entry_row(gains[RADIUS], gains[ETA], seen, G[0])
        if gains[SAMPLED] != 0.0:
            square, _, bend = entry_curvature(seen, last, seen.p_WC, seen.v_WC, seen.a_WC, scratch(n))
            near = min(square / (gains[RADIUS] * gains[RADIUS]), 1.0)
            high[0] -= 0.5 * near * seen.dt_s * bend
    fill_plane_rows(planes, gains[WALL_GAIN], seen, G[sphere : sphere + walls], high[sphere : sphere + walls])
    fill_zone_rows(zones, gains[ETA], seen, G[sphere + walls :], high[sphere + walls :])
    return H, f, seen.lower.copy(), seen.upper.copy(), G, low, high


@compiled
def vector_field_inequalities(gains: Array, seen: Seen, memory: Array, out: Resolved) -> int:
    """Minimise alpha |J_T q' - v_d|^2 + (1 - alpha) |J_w q' - w_d|^2 + lambda^2 |q'|^2 over q'.

        J_D q' <= eta (R^2 - D) - zeta           the shaft inside the sphere about the port, D = |e|^2
        D' <= eta (R^2 - D), or -D' <= ...       zones
        n . J_T q' <= gain (offset - n . p)      walls
        Omega

    v_d = v_WTd - k (p - p_d). The shaft's direction is asked to be that from the port to the commanded tip,
    which is what a surgeon's commanded orientation is in the paper, w_d = k z x z_d + z_d x z_d' + roll z.
    The RCM is no task: inside the sphere the shaft is free. With `sampled` the sphere's row has
    eta (R^2 - D) - zeta - min(D/R^2, 1) T D''/2 on its right, with the D'' of the last q' held: over a
    period D gains T D' + T^2 D''/2, of which the paper has the first part. It counts at the sphere's
    surface; in its centre D has no gradient, and nothing could be asked for.

    A program without an answer is the outcome INFEASIBLE, with its matrices attached. Memory: the last q',
    the measured one at first, and the sides of the last solution.

    Source: Marinho et al., ICRA 2019, and Marinho, Adorno, Harada and Mitsuishi, IEEE T-RO 35:1166 (2019).
    """
    n = seen.q.size
    last = memory[:n]
    if seen.first != 0:
        last[:] = seen.v
    program = vfi_program(gains, seen, last)
    x = np.empty(n)
    if not solve_warm(program, memory[n : n + n + program[5].size], x):
        return INFEASIBLE
    _answer(gains, seen, program, x, last, out)
    return GOES_ON


def _solved_in_python(solver: Solver, gains: Array, seen: Seen, memory: Array, out: Resolved) -> int:
    """The law of `vector_field_inequalities` by another solver."""
    last = memory[: seen.q.size]
    if seen.first:
        last[:] = seen.v
    program = vfi_program(gains, seen, last)
    x = solver(program)
    if x is None:
        return INFEASIBLE
    _answer(gains, seen, program, x, last, out)
    return GOES_ON


@compiled
def _answer(gains: Array, seen: Seen, program: Program, x: Array, last: Array, out: Resolved) -> None:
    """The answer inside Omega, which is remembered, what it leaves of the tip, and which rows are active."""
    G, most, sphere = program[4], program[6], 1 if seen.rows > 0 else 0
    for j in range(x.size):
        last[j] = out.qdot[j] = min(max(x[j], seen.lower[j]), seen.upper[j])
    lack = scratch(3)
    for i in range(3):
        wanted = seen.v_WTd[i] - gains[GAIN] * (seen.p_WT[i] - seen.p_WTd[i])
        lack[i] = dot(seen.Jv_WT[i], out.qdot) - wanted
    out.residual = norm(lack)
    out.values[0], out.values[1] = 0.0, 0.0
    for i in range(most.size):
        if dot(G[i], x) >= most[i] - _NEAR * (1.0 + abs(most[i])) * norm(G[i]):
            out.values[0 if i < sphere else 1] += 1.0


def _examine(gains: Array, seen: Seen, memory: Array) -> Mapping[str, Array]:
    return examined(vfi_program(gains, seen, memory[: seen.q.size]))
