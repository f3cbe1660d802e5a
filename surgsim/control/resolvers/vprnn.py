"""VPRNN: the varying-parameter recurrent neural network of the hierarchical-control paper (eq. 5-29)."""

import math
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.control.manipulability import fill_diamond, fill_diamond_product
from surgsim.control.resolvers.base import KernelResolver
from surgsim.control.resolvers.rows import answer, fill_task_rows
from surgsim.models.arm import ArmModel
from surgsim.tick.algebra import (
    back_substitute,
    back_substitute_rows,
    cross,
    dot,
    eliminate,
    factor,
    outer_product,
    times,
    transposed_times,
)
from surgsim.tick.arrays import Resolved, Seen
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.status import DIVERGED, GOES_ON, RANK_LOST

_DIVERGED = 1e12
_MOST_ROWS = 6
_EXACT_MEMORY = 25 + _MOST_ROWS

H0, H1, H2, H3, H4, K1, K2, BETA, CAP, BOUND, EULER, CROSS = range(12)
"""Places of the gains; EULER and CROSS are 0 or 1."""


class VprnnConfig(PartConfig):
    """Varying-parameter recurrent neural network with manipulability optimisation.

    Attributes:
        h0: Weight of the manipulability gradient, eq. (21).
        h1: Weight of the joint-velocity norm.
        h2: Weight of the tip row's least-squares term.
        h3: Weight of the RCM row's least-squares term.
        h4: Weight of the least-squares term of psi = vec((J J^T)^-1).
        k1: Tip feedback gain of eq. (20) [1/s].
        k2: RCM feedback gain of eq. (20) [1/s].
        beta: Convergence gain of eq. (27) [1/s].
        exponent_cap: exp(t) of eq. (27) is held at exp(exponent_cap), so that it cannot overflow.
        activation_bound: Bound of the activation function, delta+ = -delta- of eq. (28); null is linear.
        integration: `exact` steps delta in closed form, `euler` integrates eq. (29) literally.
        rcm_rows: `normal` uses two rows normal to the shaft, `cross` the three rank-2 rows of eq. (2).
    """

    shares_null_space: ClassVar[bool] = True
    type: Literal["vprnn"] = "vprnn"
    h0: NonNegativeFloat = 0.1
    h1: PositiveFloat = 10.0
    h2: NonNegativeFloat = 50.0
    h3: NonNegativeFloat = 30.0
    h4: NonNegativeFloat = 30.0
    k1: NonNegativeFloat = 5.0
    k2: NonNegativeFloat = 5.0
    beta: PositiveFloat = 1000.0
    exponent_cap: Annotated[float, Field(ge=0.0, le=700.0)] = 20.0
    activation_bound: PositiveFloat | None = None
    integration: Literal["exact", "euler"] = "exact"
    rcm_rows: Literal["normal", "cross"] = "normal"

    def build(self, arm: ArmModel) -> KernelResolver:
        """The resolver; memory delta of eq. (26), or z, l and W of the step before in the Euler form."""
        bound = math.inf if self.activation_bound is None else self.activation_bound
        n = arm.limits.q_min.size + 21 + _MOST_ROWS - 3
        return KernelResolver(
            kernel=vprnn,
            arm=arm,
            gains=np.array(
                [
                    self.h0,
                    self.h1,
                    self.h2,
                    self.h3,
                    self.h4,
                    self.k1,
                    self.k2,
                    self.beta,
                    self.exponent_cap,
                    bound,
                    self.integration == "euler",
                    self.rcm_rows == "cross",
                ],
                dtype=np.float64,
            ),
            memory_size=_EXACT_MEMORY if self.integration == "exact" else n * (n + 2),
            failures={DIVERGED: "VPRNN: a joint velocity exceeds 1e12 rad/s"},
        )


@compiled
def vprnn(gains: Array, seen: Seen, memory: Array, out: Resolved) -> int:
    """Solves W z = l, eq. (25), through the error dynamics delta' = -beta exp(t) phi(delta), eq. (27).

    In the exact form delta is stepped in closed form, saturated range included, and z follows from
    W z = l + delta. W is block-structured: psi comes from (I x J J^T) psi = vec(I) + delta_5, and
    [q', lambda1, lambda2] from a system of n + m rows; lambda3 does not feed back and is not needed.
    z starts at zero, so delta starts at -l. The Euler form integrates eq. (29) literally.

    Source: VPRNN paper, section III; eq. (20), (21), (25)-(29). A cap on exp(t) and the projection on two
    RCM rows are ours: the paper's W is singular with the three cross-product rows.
    """
    n, m = seen.q.size, network_size(gains, seen)
    J, v, qdot = scratch_matrix(m, n), scratch(m), scratch(n)
    fill_network_rows(gains, seen, J, v)
    if gains[EULER] != 0.0:
        solved = _step_euler(gains, seen, memory, J, v, qdot)
    else:
        solved = _step_exact(gains, seen, memory, J, v, qdot)
    if not solved:
        return RANK_LOST
    for j in range(qdot.size):
        if not abs(qdot[j]) < _DIVERGED:
            return DIVERGED
    answer(seen, qdot, J, v, out)
    return GOES_ON


@compiled
def network_size(gains: Array, seen: Seen) -> int:
    """Number of rows of the network: three of the tip, and two or three of the RCM with a trocar."""
    if seen.rows == 0:
        return 3
    return 6 if gains[CROSS] != 0.0 else 5


@compiled
def fill_network_rows(gains: Array, seen: Seen, J: Array, v: Array) -> None:
    """Fill rows [J_T; J_rcm] (m, n) and right side [v_d; v_rcm] (m,) of eq. (20)."""
    cross_rows = v.size == 6
    fill_task_rows(
        seen, gains[K1], gains[K2], J[: 3 if cross_rows else v.size], v[: 3 if cross_rows else v.size]
    )
    if cross_rows:
        _cross_rows(gains[K2], seen, J[3:], v[3:])


@compiled
def _cross_rows(k2: float, seen: Seen, J: Array, v: Array) -> None:
    """Rows of E_rcm = d x (p - C), eq. (2): dE = [d]x Jv + [r]x [d]x Jw; their right side d x C' - k2 E."""
    d, r, E, a, b = scratch(3), scratch(3), scratch(3), scratch(3), scratch(3)
    for i in range(3):
        d[i] = seen.R_WT[i, 2]
        r[i] = seen.p_WS[i] - seen.p_WC[i]
    cross(d, r, E)
    cross(d, seen.v_WC, a)
    for i in range(3):
        v[i] = a[i] - k2 * E[i]
    for j in range(J.shape[1]):
        cross(d, np.ascontiguousarray(seen.Jv_WS[:, j]), a)
        cross(d, np.ascontiguousarray(seen.Jw_WT[:, j]), b)
        cross(r, b, b)
        for i in range(3):
            J[i, j] = a[i] + b[i]


@compiled
def right_side(gains: Array, J: Array, v: Array, A: Array, l: Array) -> None:  # noqa: E741
    """Fill l (n + 18 + m,) of eq. (25); A = J_T J_T^T."""
    n, m = J.shape[1], v.size
    for j in range(n):
        s = 0.0
        for k in range(m):
            s += (gains[H2] if k < 3 else gains[H3]) * J[k, j] * v[k]
        l[j] = s
    for i in range(3):
        for k in range(3):
            l[n + 3 * i + k] = gains[H4] * A[i, k]
            l[n + 9 + m + 3 * i + k] = 1.0 if i == k else 0.0
    for k in range(m):
        l[n + 9 + k] = v[k]


@compiled
def _step_exact(gains: Array, seen: Seen, memory: Array, J: Array, v: Array, qdot: Array) -> bool:
    """One period of the network in closed form; False where its system is singular."""
    n, m = J.shape[1], v.size
    A, right = scratch_matrix(3, 3), scratch(n + 18 + m)
    outer_product(seen.Jv_WT, seen.Jv_WT, A)
    right_side(gains, J, v, A, right)
    delta = memory[: right.size]
    if seen.first != 0:
        for i in range(right.size):
            delta[i] = -right[i]
    t = seen.t_s
    decay(delta, gains[BETA] * exponential_integral(t, t + seen.dt_s, gains[CAP]), gains[BOUND])
    for i in range(right.size):
        right[i] += delta[i]
    return recover_qdot(gains, seen.Jv_WT, seen.z_W, J, A, right, qdot)


@compiled
def decay(delta: Array, progress: float, bound: float) -> None:
    """The error after one period, in place: the closed form of eq. (27) with the activation (28).

    The linear range decays as exp(-progress), progress = beta times the integral of exp(t); a saturated entry
    falls at its bound's rate until then.
    """
    factor_ = math.exp(-progress)
    for i in range(delta.size):
        size = abs(delta[i])
        if size <= bound:
            left = size * factor_
        else:
            until = (size - bound) / bound
            left = bound * math.exp(-(progress - until)) if until < progress else size - bound * progress
        delta[i] = left if delta[i] > 0.0 else -left


@compiled
def exponential_integral(start: float, end: float, cap: float) -> float:
    """Integral of min(exp(t), exp(cap)) from `start` to `end`."""
    grows_to = min(end, cap)
    grown = math.exp(grows_to) - math.exp(start) if start < grows_to else 0.0
    return grown + math.exp(cap) * max(end - max(start, cap), 0.0)


@compiled
def recover_qdot(gains: Array, Jv: Array, z_W: Array, J: Array, A: Array, rhs: Array, qdot: Array) -> bool:
    """Joint velocity q' (n,) of W z = rhs through the block structure of W; False where W is singular.

        psi = vec(A^-1 Rhs_5),  P = h1 I + h2 J_T^T J_T + h3 J_rcm^T J_rcm,  b = rhs_q + h0 D psi
        (J P^-1 J^T) lambda = rhs_J - J P^-1 b,  q' = P^-1 (b + J^T lambda)

    The three cross-product rows have rank 2: their least-squares solution is taken.
    """
    n, m = J.shape[1], J.shape[0]
    L, X = scratch_matrix(3, 3), scratch_matrix(3, 3)
    L[:] = A
    if not factor(L):
        return False
    for i in range(3):
        for k in range(3):
            X[i, k] = rhs[n + 9 + m + 3 * i + k]
    back_substitute_rows(L, X)
    P, b, weighed = scratch_matrix(n, n), scratch(n), scratch(m)
    fill_diamond_product(Jv, z_W, X, b)
    for i in range(n):
        b[i] = rhs[i] + gains[H0] * b[i]
        for k in range(m):
            weighed[k] = (gains[H2] if k < 3 else gains[H3]) * J[k, i]
        for j in range(i + 1):
            s = gains[H1] if i == j else 0.0
            for k in range(m):
                s += weighed[k] * J[k, j]
            P[i, j] = s
            P[j, i] = s
    if gains[CROSS] != 0.0 and m > 3:
        return _least_squares(P, J, b, rhs[n + 9 : n + 9 + m], qdot)
    if not factor(P):
        return False
    Y, S, gap = scratch_matrix(m, n), scratch_matrix(m, m), scratch(m)
    Y[:] = J
    back_substitute_rows(P, Y)
    outer_product(J, Y, S)
    if not factor(S):
        return False
    for k in range(m):
        gap[k] = rhs[n + 9 + k] - dot(Y[k], b)
    back_substitute(S, gap)
    transposed_times(J, gap, qdot)
    for j in range(n):
        qdot[j] += b[j]
    back_substitute(P, qdot)
    return True


@compiled
def _least_squares(P: Array, J: Array, b: Array, v: Array, qdot: Array) -> bool:
    """Q' of [P -J^T; J 0] [q'; lambda] = [b; v] in the least-squares sense, singular values cut at 1e-10."""
    n, m = J.shape[1], J.shape[0]
    K, right = np.zeros((n + m, n + m)), np.empty(n + m)
    K[:n, :n] = P
    K[:n, n:] = -J.T
    K[n:, :n] = J
    right[:n] = b
    right[n:] = v
    if not np.isfinite(K).all() or not np.isfinite(right).all():
        return False
    qdot[:] = np.linalg.lstsq(K, right, 1e-10)[0][:n]
    return True


@compiled
def system(gains: Array, J: Array, A: Array, D: Array) -> Array:
    """W (n + 18 + m) square of eq. (25), for z = [q', psi, lambda1, lambda2, lambda3]."""
    n, m = J.shape[1], J.shape[0]
    W = np.zeros((n + 18 + m, n + 18 + m))
    AA = np.empty((3, 3))
    outer_product(A, A, AA)
    tail = n + 9 + m
    for i in range(n):
        for j in range(n):
            s = gains[H1] if i == j else 0.0
            for k in range(m):
                s += (gains[H2] if k < 3 else gains[H3]) * J[k, i] * J[k, j]
            W[i, j] = s
        for k in range(9):
            W[i, n + k] = W[n + k, i] = -gains[H0] * D[i, k]
        for k in range(m):
            W[i, n + 9 + k] = -J[k, i]
            W[n + 9 + k, i] = J[k, i]
    for block in range(3):
        for i in range(3):
            for k in range(3):
                row, column = 3 * block + i, 3 * block + k
                W[n + row, n + column] = gains[H4] * AA[i, k]
                W[n + row, tail + column] = -A[i, k]
                W[tail + row, n + column] = A[i, k]
    return W


@compiled
def _step_euler(gains: Array, seen: Seen, memory: Array, J: Array, v: Array, qdot: Array) -> bool:
    """Explicit Euler of eq. (29), z' = W^-1 (-W' z + l' - beta exp(t) phi(W z - l)); W', l' backward."""
    n, m = J.shape[1], v.size
    size = n + 18 + m
    z, l_old = memory[:size], memory[size : 2 * size]
    W_old = memory[2 * size : (2 + size) * size].reshape((size, size))
    A, l = np.empty((3, 3)), np.empty(size)  # noqa: E741 - the paper's name
    outer_product(seen.Jv_WT, seen.Jv_WT, A)
    right_side(gains, J, v, A, l)
    D = scratch_matrix(n, 9)
    fill_diamond(seen.Jv_WT, seen.z_W, D)
    W = system(gains, J, A, D)
    if seen.first != 0:
        l_old[:] = l
        W_old[:] = W
    dt, bound = seen.dt_s, gains[BOUND]
    gain = gains[BETA] * math.exp(min(seen.t_s, gains[CAP]))
    rate, last = np.empty(size), np.empty(size)
    times(W, z, rate)
    times(W_old, z, last)
    for i in range(size):
        phi = min(max(rate[i] - l[i], -bound), bound)
        rate[i] = (l[i] - l_old[i] - rate[i] + last[i]) / dt - gain * phi
    l_old[:] = l
    W_old[:] = W
    if gains[CROSS] != 0.0 and m > 3:
        if not np.isfinite(W).all() or not np.isfinite(rate).all():
            return False
        rate[:] = np.linalg.lstsq(W, rate, 1e-10)[0]
    elif not eliminate(W, rate):
        return False
    for i in range(size):
        z[i] += dt * rate[i]
    qdot[:] = z[:n]
    return True
