"""Kernels of the self-motion manifold: the way back to it, and uphill in manipulability along it.

They evaluate a nominal model of their own where they go. A point of the manifold is its joint positions.
"""

from typing import NamedTuple

import numpy as np

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.control.manipulability import (
    fill_chain_slope,
    fill_gradient,
    fill_gradient_slope,
    fill_weighted_columns,
    manipulability,
)
from surgsim.control.rcm import fill_rcm
from surgsim.tick.algebra import (
    back_substitute,
    cross,
    diagonalise,
    dot,
    factor,
    norm,
    null_space,
    outer_product,
    times,
    transposed_times,
)
from surgsim.tick.arrays import Model
from surgsim.tick.nominal import kinematics
from surgsim.tick.quadratic_program import SOLVED, solve
from surgsim.tick.scratch import scratch, scratch_matrix

PROJECTION_STEPS = 8
CLIMB_STEPS, CLIMB_TOLERANCE_RAD = 60, 1e-9
_RADIUS_RAD = 0.3
_ON_M = 1e-8
_OUTSIDE_RAD = 1e-6
_LEAST_CURVATURE = 0.05


class Manifold(NamedTuple):
    """All joint positions with the tip in its place and, with a trocar, the shaft through it.

    Attributes:
        rows: Constraints: 5, or 3 without a trocar.
        p_WT: Tip position (3,) [m].
        p_WC: Trocar position (3,) [m]; not read without one.
        low: Lowest joint positions (n,) [rad].
        high: Highest joint positions (n,) [rad].
    """

    rows: int
    p_WT: Array
    p_WC: Array
    low: Array
    high: Array


@compiled
def fill_constraints(model: Model, on: Manifold, J: Array, residual: Array) -> None:
    """Constraint Jacobian (rows, n) and residual (rows,) [m] where `model` has been evaluated."""
    for i in range(3):
        J[i] = model.Jv_WT[i]
        residual[i] = model.p_WT[i] - on.p_WT[i]
    if on.rows > 3:
        at_rest, rate, normals = scratch(3), scratch(2), scratch_matrix(2, 3)
        at_rest[:] = 0.0
        fill_rcm(
            model.p_WS,
            model.R_WT,
            model.Jv_WS,
            model.Jw_WT,
            on.p_WC,
            at_rest,
            residual[3:],
            J[3:],
            rate,
            normals,
        )


@compiled
def project(model: Model, on: Manifold, q: Array, steps: int) -> tuple[bool, float]:
    """Q (n,) becomes the point of the manifold near it: Newton steps q -= J^T (J J^T)^-1 r, of least motion.

    Returns:
        Whether J kept its rank, and the norm of what the constraints lack [m]. `model` is evaluated at q.
    """
    J, r, A = scratch_matrix(on.rows, q.size), scratch(on.rows), scratch_matrix(on.rows, on.rows)
    kinematics(model, q)
    fill_constraints(model, on, J, r)
    for _ in range(steps):
        if dot(r, r) < 1e-24:
            break
        outer_product(J, J, A)
        if not factor(A):
            return False, norm(r)
        back_substitute(A, r)
        for j in range(q.size):
            for i in range(on.rows):
                q[j] -= J[i, j] * r[i]
        kinematics(model, q)
        fill_constraints(model, on, J, r)
    return True, norm(r)


@compiled
def improve(model: Model, on: Manifold, q: Array, radius: float, step: Array) -> bool:
    """Joint displacement `step` (n,) [rad] towards larger mu, tangent to the manifold, inside the limits.

        step = Z^T y,   y = |C|^-1 Z g,   g = grad(ln mu),   C = -Z d/dZ (g - J^T l),   l = (J J^T)^-1 J g

    A Newton step on ln(mu) with the curvature of the manifold through the Lagrangian, its eigenvalues made
    positive, at most `radius` [rad] long. The rows of Z span the null space of J. `model` has been evaluated
    at q. False where J has lost rank.
    """
    m, n = on.rows, q.size
    J, A, g, multiplier, r = scratch_matrix(m, n), scratch_matrix(m, m), scratch(n), scratch(m), scratch(m)
    columns, B = scratch_matrix(n, 3), scratch_matrix(n, 3)
    fill_constraints(model, on, J, r)
    outer_product(J, J, A)
    if not factor(A) or not fill_weighted_columns(model.Jv_WT, columns, B):
        return False
    fill_gradient(columns, model.z_W, B, g)
    times(J, g, multiplier)
    back_substitute(A, multiplier)
    Z, C, V = scratch_matrix(n - m, n), scratch_matrix(n - m, n - m), scratch_matrix(n - m, n - m)
    null_space(J, Z)
    fill_curvature(model, on, columns, B, Z, multiplier, C)
    diagonalise(C, V)
    reduced, y, turned = scratch(n - m), scratch(n - m), scratch(n - m)
    times(Z, g, reduced)
    transposed_times(V, reduced, turned)
    for k in range(n - m):
        C[k, k] = max(abs(C[k, k]), _LEAST_CURVATURE)
        turned[k] /= C[k, k]
    times(V, turned, y)
    transposed_times(Z, y, step)
    shorter, inside = min(1.0, radius / max(norm(step), 1e-12)), True
    for j in range(n):
        step[j] *= shorter
        inside = inside and on.low[j] <= q[j] + step[j] <= on.high[j]
    if not inside:
        _fill_bounded(on, q, Z, C, V, reduced, radius, step)
    return True


@compiled
def fill_curvature(
    model: Model, on: Manifold, J: Array, B: Array, Z: Array, multiplier: Array, C: Array
) -> None:
    """C (k, k) of `improve`, symmetric, from the rows of `fill_weighted_columns` and Z (k, n).

    J^T multiplier is a wrench at the tip: its entries are f . J_j + t . z_j, with the force f and the moment
    t of `_fill_wrench`.
    """
    k, n = Z.shape
    z = model.z_W
    dJ, dz, tip, slope = scratch_matrix(n, 3), scratch_matrix(n, 3), scratch_matrix(2, 3), scratch(n)
    wrench, change = scratch_matrix(2, 3), scratch_matrix(2, 3)
    for a in range(k):
        fill_chain_slope(J, z, Z[a], dJ, dz, tip)
        fill_gradient_slope(J, z, B, dJ, dz, slope)
        _fill_wrench(model, on, multiplier, tip, wrench, change)
        for j in range(n):
            for i in range(3):
                slope[j] -= wrench[0, i] * dJ[j, i] + wrench[1, i] * dz[j, i]
                slope[j] -= change[0, i] * J[j, i] + change[1, i] * z[j, i]
        for b in range(k):
            C[b, a] = -dot(Z[b], slope)
    for a in range(k):
        for b in range(a):
            C[a, b] = C[b, a] = 0.5 * (C[a, b] + C[b, a])


@compiled
def _fill_wrench(
    model: Model, on: Manifold, multiplier: Array, tip: Array, wrench: Array, change: Array
) -> None:
    """Rows force and moment (2, 3) of the constraints' multipliers, and how they change with the tip.

        f = l_1..3 + a,   t = s b + o x a,   a = l_4 n_1 + l_5 n_2,   b = l_5 n_1 - l_4 n_2
        df = w x a,   dt = ds b + s w x b + w x (o x a)
        s = d . (p_S - C),   ds = (w x d) . (p_S - C) + d . (dp + w x o)

    The rows of `tip` (2, 3) are its displacement dp and its turn w; n_1, n_2 and d are its axes, and the
    shaft's end p_S is o from it.
    """
    change[:] = 0.0
    for i in range(3):
        wrench[0, i], wrench[1, i] = multiplier[i], 0.0
    if on.rows == 3:
        return
    R = model.R_WT
    a, b, d, turned = scratch(3), scratch(3), scratch(3), scratch(3)
    s = ds = 0.0
    for i in range(3):
        a[i] = multiplier[3] * R[i, 0] + multiplier[4] * R[i, 1]
        b[i] = multiplier[4] * R[i, 0] - multiplier[3] * R[i, 1]
        d[i] = R[i, 2]
    cross(tip[1], d, turned)
    for i in range(3):
        reach = model.p_WS[i] - on.p_WC[i]
        s += d[i] * reach
        ds += turned[i] * reach + d[i] * tip[0, i]
    cross(tip[1], a, change[0])
    cross(tip[1], b, turned)
    for i in range(3):
        wrench[0, i] += a[i]
        wrench[1, i] = s * b[i]
        change[1, i] = ds * b[i] + s * turned[i]
    if model.angled:
        _add_offset(model, a, b, d, tip[1], wrench, change)


@compiled
def _add_offset(model: Model, a: Array, b: Array, d: Array, w: Array, wrench: Array, change: Array) -> None:
    """Add to the moment and its change what the offset o of the shaft's end from the tip makes of a and b."""
    o, about, turned = scratch(3), scratch(3), scratch(3)
    for i in range(3):
        o[i] = model.p_WS[i] - model.p_WT[i]
    cross(w, o, turned)
    ds = dot(d, turned)
    cross(o, a, about)
    cross(w, about, turned)
    for i in range(3):
        wrench[1, i] += about[i]
        change[1, i] += ds * b[i] + turned[i]


@compiled
def _fill_bounded(
    on: Manifold, q: Array, Z: Array, w: Array, V: Array, reduced: Array, radius: float, step: Array
) -> None:
    """The step of `improve` inside joint limits and a box of `radius`; zero if there is none.

    min 1/2 y^T V w V^T y - reduced^T y   subject to   |y_k| <= radius,   low <= q + Z^T y <= high
    """
    k, n = Z.shape
    B, G, f, y = np.empty((k, k)), np.empty((n, k)), np.empty(k), np.zeros(k)
    low, high = np.empty(n), np.empty(n)
    for a in range(k):
        f[a] = -reduced[a]
        for b in range(k):
            B[a, b] = 0.0
            for c in range(k):
                B[a, b] += V[a, c] * w[c, c] * V[b, c]
        for j in range(n):
            G[j, a] = Z[a, j]
    for j in range(n):
        low[j], high[j] = on.low[j] - q[j], on.high[j] - q[j]
    work, active, side = np.zeros((2 * k + 7, k + 1)), np.zeros(k + 1, np.int64), np.zeros(k + n, np.int64)
    box = np.full(k, radius)
    if solve(B, f, -box, box, G, low, high, side, y, work, active) != SOLVED:
        y[:] = 0.0
    transposed_times(Z, y, step)


@compiled
def climb(model: Model, on: Manifold, q: Array, steps: int, tolerance: float) -> tuple[bool, float, float]:
    """Q (n,) becomes the local maximum of mu that is reached from it by self-motion inside the limits.

    Ends at a step shorter than `tolerance` [rad].

    Returns:
        Whether J kept its rank on the way, the norm of what the constraints lack [m], and mu.
    """
    step, trial = scratch(q.size), scratch(q.size)
    ranked, miss = project(model, on, q, PROJECTION_STEPS)
    mu, radius, is_here = manipulability(model.Jv_WT), _RADIUS_RAD, True
    for _ in range(steps):
        if not is_here:
            kinematics(model, q)
        if not ranked or not improve(model, on, q, radius, step):
            return False, miss, mu
        if dot(step, step) < tolerance * tolerance:
            break
        for j in range(q.size):
            trial[j] = min(max(q[j] + step[j], on.low[j]), on.high[j])
        is_back, trial_miss = project(model, on, trial, PROJECTION_STEPS)
        trial_mu = manipulability(model.Jv_WT)
        is_here = is_back and _is_better(on, q, mu, trial, trial_miss, trial_mu)
        if is_here:
            q[:] = trial
            miss, mu, radius = trial_miss, trial_mu, min(2.0 * radius, _RADIUS_RAD)
        else:
            radius *= 0.25
            if radius < tolerance:
                break
    return ranked, miss, mu


@compiled
def _is_better(on: Manifold, q: Array, mu: float, trial: Array, trial_miss: float, trial_mu: float) -> bool:
    """Whether `trial` (n,) has a larger mu inside the limits, or is nearer to their inside."""
    outside = how_far_outside(on, q)
    if outside > _OUTSIDE_RAD:
        return trial_miss < _ON_M and how_far_outside(on, trial) < 0.9 * outside
    return trial_mu > mu and is_inside(on, trial, trial_miss)


@compiled
def how_far_outside(on: Manifold, q: Array) -> float:
    """How far the worst joint is outside its range [rad]."""
    worst = 0.0
    for j in range(q.size):
        worst = max(worst, on.low[j] - q[j], q[j] - on.high[j])
    return worst


@compiled
def is_inside(on: Manifold, q: Array, miss: float) -> bool:
    """Whether q (n,), which lacks `miss` [m], is on the manifold and inside the joint limits."""
    return how_far_outside(on, q) <= _OUTSIDE_RAD and miss < _ON_M


@compiled
def climb_from(
    model: Model, on: Manifold, here: Array, mu: float, offset: Array, goal: Array
) -> tuple[bool, float, float]:
    """`goal` (n,): the optimum uphill of `here` + `offset`.

    Returns:
        Whether it is inside the limits and can be reached from `here`, where mu is `mu`; the norm of what
        the constraints lack there [m]; and mu there.
    """
    n = here.size
    for j in range(n):
        goal[j] = min(max(here[j] + offset[j], on.low[j]), on.high[j])
    ranked, miss, height = climb(model, on, goal, CLIMB_STEPS, CLIMB_TOLERANCE_RAD)
    counts = ranked and is_inside(on, goal, miss) and _can_reach(model, on, here, goal, 0.5 * min(mu, height))
    return counts, miss, height


@compiled
def _can_reach(model: Model, on: Manifold, here: Array, goal: Array, lowest: float) -> bool:
    """Whether stepping along the joint-space line to `goal`, each time back on the manifold, arrives.

    A path that comes near a singularity, where mu is below `lowest`, does not count.
    """
    q = here.copy()
    for left in range(40, 0, -1):
        for j in range(q.size):
            q[j] += (goal[j] - q[j]) / left
        ranked, miss = project(model, on, q, 4)
        if not ranked or miss > 1e-4 or manipulability(model.Jv_WT) < lowest:
            return False
    worst = 0.0
    for j in range(q.size):
        worst = max(worst, abs(q[j] - goal[j]))
    return worst < 0.1
