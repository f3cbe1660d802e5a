"""RCM model-predictive control: tip, RCM and posture over a horizon, inside the limits of all of it."""

import math
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.control.acceleration import TORQUE_SHARE, top_speed
from surgsim.control.elastic_observer import (
    DELAY,
    RATE,
    ElasticObserverConfig,
    last_sent,
    look_ahead,
    send,
)
from surgsim.control.torque_laws.base import KernelTorqueLaw
from surgsim.control.torque_laws.rcm_hierarchy import fill_task_errors
from surgsim.models.arm import ArmModel
from surgsim.tick.algebra import times
from surgsim.tick.arrays import Model, Seen
from surgsim.tick.quadratic_program import SOLVED, solve
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.status import GOES_ON, INFEASIBLE

Ids = NDArray[np.int64]

BLOCKS, HORIZON, VELOCITY_TIME, W_RCM, W_JOINT, K_JOINT, D_JOINT = range(7)
"""Places of the gains; the observer's follow."""
OBSERVER = 7
MOTION, BIAS, DISTURBANCE, LIMITS = range(4)
TERMS = ("motion", "bias", "observer", "limits")
"""Rows of the terms."""
_BANDWIDTH_TIMES_HORIZON = 2.3


class RcmMpcConfig(ElasticObserverConfig):
    """Model-predictive control of tip and RCM, with joint accelerations in blocks over a short horizon.

    Attributes:
        horizon_s: Length of the horizon [s]; null: as short as the drives allow, between 20 and 50 ms.
        blocks: Into how many blocks of constant acceleration it is divided.
        velocity_share: Time by which a rate of an error is weighed against the error, over the horizon.
        rcm_weight: Weight of the squared RCM error over that of the tip.
        joint_weight: Weight of what the posture lacks over that of the tip, at accelerations that reach as
            far in the first block.
        joint_bandwidth_rad_per_s: About the joint reference, for what tip and RCM leave free [rad/s].
        bandwidth_share: With `horizon_s: null`, natural frequency of the errors over the lowest
            sqrt(K / B_s) of the drives.
        most_bandwidth_rad_per_s: It is at most this then [rad/s].
    """

    type: Literal["rcm_mpc"] = "rcm_mpc"
    horizon_s: Annotated[float, Field(ge=0.005, le=0.1)] | None = None
    blocks: Annotated[int, Field(ge=1, le=5)] = 3
    velocity_share: PositiveFloat = 0.4
    rcm_weight: PositiveFloat = 100.0
    joint_weight: PositiveFloat = 1e-3
    joint_bandwidth_rad_per_s: NonNegativeFloat = 10.0
    bandwidth_share: PositiveFloat = 0.4
    most_bandwidth_rad_per_s: PositiveFloat = 85.0

    def build(self, arm: ArmModel) -> KernelTorqueLaw:
        """The law; memory of the observer, then the sides of the last solution."""
        n, horizon, joint = arm.limits.torque.size, self.horizon_s, self.joint_bandwidth_rad_per_s
        if horizon is None:
            bandwidth = min(self.bandwidth_share * arm.locked_frequency, self.most_bandwidth_rad_per_s)
            horizon = min(max(_BANDWIDTH_TIMES_HORIZON / bandwidth, 0.02), 0.05)
        own = (
            float(self.blocks),
            horizon,
            self.velocity_share * horizon,
            self.rcm_weight,
            self.joint_weight,
            joint * joint,
            2.0 * joint,
        )
        return KernelTorqueLaw(
            kernel=rcm_mpc,
            arm=arm,
            terms=TERMS,
            gains=np.concatenate([own, self.numbers(arm)]),
            memory_size=self.memory_size(n) + rows_of(n, self.blocks),
            failures={INFEASIBLE: "no joint accelerations over the horizon keep all limits"},
        )


@compiled
def rows_of(n: int, blocks: int) -> int:
    """Variables and rows of the program of n joints: accelerations; then torques and velocities."""
    return 3 * n * blocks


@compiled
def rcm_mpc(gains: Array, seen: Seen, memory: Array, out: Array) -> int:
    """U = (M + B_s) u_1 + c + D_l v - d + f, with the first of a horizon's accelerations.

    They are the u_k, k = 1 .. N, that minimise

        sum_k |e_T(t_k)|^2 + T_v^2 |e_T'(t_k)|^2 + w_r (|e_N(t_k)|^2 + T_v^2 |e_N'(t_k)|^2)
            + w_q c_1^2 sum_k |u_k - k_q (q_ref - q) - d_q (q_ref' - q')|^2_M / N

    over a horizon H of N blocks of h = H/N, t_k = k h, at whose ends the errors of tip and RCM are

        e(t_k)  = e + e' t_k + (J' q' - a_ref) t_k^2 / 2 + J sum_{j<=k} c_kj u_j,  c_kj = h^2 (k - j + 1/2)
        e'(t_k) = e' + (J' q' - a_ref) t_k + J sum_{j<=k} h u_j

    with J, J' q', M and c of the state in which the torque will act (`surgsim.control.elastic_observer`), the
    trocar and the command carried on with their velocities and accelerations. c_1 = h^2/2. Subject to, at
    every block,

        |(M + B_s) u_k + c + D_l v - d + f| <= tau_max,   |u - u_last| <= rate T        (the first alone)
        |q'(t_k)| <= the speed from which a joint can stop before its range ends, from where it is now

    That speed is at most ten times the room a second: within a horizon of 0.1 s no joint leaves its range. A
    joint that is too fast already has to brake by the end of the first block. Where the rate excludes that,
    it gives way in the program, and the interface cuts the command; where the other rows exclude each other,
    the run ends as INFEASIBLE. The program is solved exactly at every tick, and starts from the active rows
    of the last one.

    Without active limits and for w_q -> 0 all errors obey e'' = -k e - d e', with k and d from N, H and T_v
    alone: for N = 3 and T_v = 0.4 H a natural frequency of 2.3/H and a damping ratio of 0.85.

    Rows motion, bias, observer, limits (4, n) [N m].

    Source: ours, in the form of linear MPC with condensed states, Maciejowski, Predictive Control with
    Constraints (2002), chapter 2; the rows of limits are those of `surgsim.control.acceleration`.
    """
    n, numbers = seen.q.size, gains[OBSERVER:]
    blocks = int(gains[BLOCKS])
    size = memory.size - rows_of(n, blocks)
    d, touch = scratch(n), scratch(n)
    touch[:] = 0.0
    status = look_ahead(numbers, seen, memory[:size], touch, d)
    if status != GOES_ON:
        return status
    u = np.empty(n * blocks)
    status = plan(gains, seen, seen.elsewhere, d, last_sent(memory, n), memory[size:], u)
    if status != GOES_ON:
        return status
    times(seen.elsewhere.M, u[:n], out[MOTION])
    for i in range(n):
        out[BIAS, i] = seen.elsewhere.bias[i] + seen.damping[i] * seen.elsewhere.v[i]
        out[DISTURBANCE, i] = -d[i]
        out[LIMITS, i] = 0.0
    send(numbers, seen, memory[:size], out, LIMITS)
    return GOES_ON


@compiled
def plan(gains: Array, seen: Seen, model: Model, d: Array, last: Array, remembered: Array, u: Array) -> int:
    """The accelerations of all blocks u (N n,) from `model`'s state; a status.

    Args:
        gains: The law's.
        seen: Command, trocar, limits.
        model: The arm at the state that the horizon begins with.
        d: Disturbance torque (n,) [N m].
        last: Torque of the last tick (n,) [N m].
        remembered: Sides of the last solution (3 N n,), changed.
        u: Filled [rad/s^2].
    """
    H, f, lower, upper, G, low, high = program(gains, seen, model, d)
    n, size, numbers = last.size, u.size, gains[OBSERVER:]
    most = numbers[RATE] * seen.dt_s
    work, active = np.zeros((2 * size + 7, size + 1)), np.zeros(size + 1, np.int64)
    side = np.zeros(remembered.size, np.int64)
    narrow_low, narrow_high = low.copy(), high.copy()
    for i in range(n):
        constant = model.bias[i] + seen.damping[i] * model.v[i] - d[i]
        narrow_low[i] = min(max(low[i], last[i] - most - constant), high[i])
        narrow_high[i] = max(min(high[i], last[i] + most - constant), low[i])
    for attempt in range(2):
        for i in range(side.size):
            side[i] = int(remembered[i]) if attempt == 0 else 0
        if attempt == 1:
            narrow_low[:n], narrow_high[:n] = low[:n], high[:n]
        if solve(H, f, lower, upper, G, narrow_low, narrow_high, side, u, work, active) == SOLVED:
            for i in range(side.size):
                remembered[i] = side[i]
            return GOES_ON
    return INFEASIBLE


@compiled
def program(
    gains: Array, seen: Seen, model: Model, d: Array
) -> tuple[Array, Array, Array, Array, Array, Array, Array]:
    """H, f, bounds and rows of the program over the accelerations, without the rate of the torque."""
    n, blocks = seen.q.size, int(gains[BLOCKS])
    size, h = n * blocks, gains[HORIZON] / blocks
    M, first = model.M, 0.5 * h * h
    A, P = scratch_matrix(n, n), scratch_matrix(3, n)
    _quadratic(gains, seen, model, A, P)
    posture, pulled = scratch(n), scratch(n)
    for i in range(n):
        posture[i] = gains[K_JOINT] * (seen.q_ref[i] - model.q[i])
        posture[i] += gains[D_JOINT] * (seen.qdot_ref[i] - model.v[i])
    times(M, posture, pulled)
    H, f = np.zeros((size, size)), np.zeros(size)
    unit, share = 1.0 / (first * first), gains[W_JOINT] / blocks
    square = gains[VELOCITY_TIME] * gains[VELOCITY_TIME]
    for j in range(blocks):
        for k in range(j, blocks):
            t, reach = (k + 1) * h, h * h * (k - j + 0.5)
            for i in range(n):
                by = reach * (P[0, i] + t * (P[1, i] + 0.5 * t * P[2, i]))
                f[j * n + i] += unit * (by + square * h * (P[1, i] + t * P[2, i]))
        for c in range(j + 1):
            both = 0.0
            for k in range(j, blocks):
                both += h * h * (h * (k - j + 0.5) * h * (k - c + 0.5) + square)
            for i in range(n):
                for o in range(n):
                    H[j * n + i, c * n + o] = unit * both * A[i, o]
        for i in range(n):
            f[j * n + i] -= share * pulled[i]
            for o in range(n):
                H[j * n + i, j * n + o] += share * M[i, o]
    for i in range(size):
        for o in range(i):
            H[o, i] = H[i, o]
    lower, upper = np.full(size, -math.inf), np.full(size, math.inf)
    G, low, high = np.zeros((2 * size, size)), np.empty(2 * size), np.empty(2 * size)
    _fill_limits(seen, model, d, h, G, low, high)
    return H, f, lower, upper, G, low, high


@compiled
def _quadratic(gains: Array, seen: Seen, model: Model, A: Array, P: Array) -> None:
    """A = J^T W J (n, n), and P (3, n) = J^T W times errors, their rates, and their free accelerations."""
    n, m = seen.q.size, 3 + seen.rows
    J, error, rate, bias = scratch_matrix(m, n), scratch(m), scratch(m), scratch(m)
    late = gains[OBSERVER + DELAY] * seen.dt_s
    fill_task_errors(seen, model, late, late, J, error, rate, bias)
    for i in range(n):
        P[0, i] = P[1, i] = P[2, i] = 0.0
        for j in range(n):
            A[i, j] = 0.0
    for k in range(m):
        weight = 1.0 if k < 3 else gains[W_RCM]
        for i in range(n):
            by = weight * J[k, i]
            P[0, i] += by * error[k]
            P[1, i] += by * rate[k]
            P[2, i] += by * bias[k]
            for j in range(n):
                A[i, j] += by * J[k, j]


@compiled
def _fill_limits(seen: Seen, model: Model, d: Array, h: float, G: Array, low: Array, high: Array) -> None:
    """Rows of torques and velocities: N n of each, block by block."""
    n, size = seen.q.size, G.shape[1]
    for k in range(size // n):
        at = k * n
        for i in range(n):
            constant = model.bias[i] + seen.damping[i] * model.v[i] - d[i]
            most = TORQUE_SHARE * seen.tau_max[i]
            low[at + i], high[at + i] = -most - constant, most - constant
            for j in range(n):
                G[at + i, at + j] = model.M[i, j]
            fast = size + at + i
            for j in range(k + 1):
                G[fast, j * n + i] = h
            high[fast] = top_speed(seen, i, seen.q_max[i] - model.q[i]) - model.v[i]
            low[fast] = -top_speed(seen, i, model.q[i] - seen.q_min[i]) - model.v[i]
