"""Torques of two tasks and a posture that do not disturb what is above them."""

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.control.torque_laws.hierarchical_impedance import project_torque
from surgsim.tick.algebra import (
    back_substitute,
    back_substitute_rows,
    dot,
    factor,
    outer_product,
    times,
    transposed_times,
)
from surgsim.tick.scratch import scratch, scratch_matrix


@compiled
def decouple(M: Array, first: Array, a: Array, second: Array, b: Array, posture: Array, out: Array) -> bool:
    """Fill three torques, whose sum moves the arm by what is asked for, in strict priority.

        out[0] = J_1' F_1,      F_1 = (J_1 M^-1 J_1')^-1 a
        out[1] = N_1 J_2' F_2,  F_2 = (J_2 M^-1 N_1 J_2')^-1 (b - J_2 M^-1 J_1' F_1)
        out[2] = N_2 M q''_0
        N_i    = I - J_i' (J_i M^-1 J_i')^-1 J_i M^-1,  with J_1, and with [J_1; J_2] for i = 2

    Where the rows of both tasks are independent both are met, and the order of the two makes no difference.

    Args:
        M: Inertia (n, n).
        first: J_1 (m, n), without rows if there is no such task.
        a: What J_1 q'' shall be (m,).
        second: J_2 (k, n), likewise.
        b: What J_2 q'' shall be (k,).
        posture: q''_0 (n,) [rad/s^2].
        out: Filled (3, n) [N m].

    Returns:
        False where the rows of a task depend on one another, or on those above.

    Source: Khatib (1987); with the projectors that Dietrich, Ott and Albu-Schaeffer, "An overview of null
    space projections for redundant, torque-controlled robots" (2015), call dynamically consistent.
    """
    n, m, k = posture.size, a.size, b.size
    J, moved, L = scratch_matrix(m + k, n), scratch_matrix(m + k, n), scratch_matrix(n, n)
    J[:m], J[m:], L[:] = first, second, M
    moved[:] = J
    if not factor(L):
        return False
    back_substitute_rows(L, moved)
    if not task_torque(J[:m], moved[:m], a, out[0]):
        return False
    below, left = scratch_matrix(k, n), scratch(k)
    below[:] = second
    for i in range(k):
        left[i] = b[i] - dot(moved[m + i], out[0])
        if m > 0 and not project_torque(J[:m], moved[:m], below[i]):
            return False
    if not task_torque(below, moved[m:], left, out[1]):
        return False
    times(M, posture, out[2])
    return project_torque(J, moved, out[2])


@compiled
def task_torque(J: Array, moved: Array, a: Array, out: Array) -> bool:
    """Out = J^T (J Y^T)^-1 a (n,), with Y = `moved`, each (m, n); False where J Y^T is not positive definite.

    Without rows it is zero.
    """
    out[:] = 0.0
    if a.size == 0:
        return True
    mobility, force = scratch_matrix(a.size, a.size), scratch(a.size)
    outer_product(moved, J, mobility)
    if not factor(mobility):
        return False
    force[:] = a
    back_substitute(mobility, force)
    transposed_times(J, force, out)
    return True
