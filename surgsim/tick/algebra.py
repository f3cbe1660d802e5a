"""Small dense linear algebra for kernels: nothing allocated but what is returned, nothing raised.

Loops in a fixed order: the compiled and the Python form give the same bits, which BLAS does not promise.
"""

import math

import numpy as np

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.tick.scratch import scratch, scratch_matrix

DEPENDENT = 1e-14
"""A pivot below this share of its diagonal entry counts as lost rank."""
_SWEEPS = 20  # Jacobi's method needs about six


@compiled
def dot(a: Array, b: Array) -> float:
    """Inner product."""
    s = 0.0
    for i in range(a.size):
        s += a[i] * b[i]
    return s


@compiled
def norm(a: Array) -> float:
    """Euclidean norm."""
    return math.sqrt(dot(a, a))


@compiled
def cross(a: Array, b: Array, out: Array) -> None:
    """Out = a x b, each (3,)."""
    x = a[1] * b[2] - a[2] * b[1]
    y = a[2] * b[0] - a[0] * b[2]
    z = a[0] * b[1] - a[1] * b[0]
    out[0], out[1], out[2] = x, y, z


@compiled
def times(A: Array, x: Array, out: Array) -> None:
    """Out = A x, A (m, n)."""
    for i in range(A.shape[0]):
        s = 0.0
        for j in range(A.shape[1]):
            s += A[i, j] * x[j]
        out[i] = s


@compiled
def transposed_times(A: Array, x: Array, out: Array) -> None:
    """Out = A^T x, A (m, n)."""
    for j in range(A.shape[1]):
        out[j] = 0.0
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            out[j] += A[i, j] * x[i]


@compiled
def outer_product(A: Array, B: Array, out: Array) -> None:
    """Out = A B^T, A (m, n) and B (k, n)."""
    for i in range(A.shape[0]):
        for j in range(B.shape[0]):
            s = 0.0
            for k in range(A.shape[1]):
                s += A[i, k] * B[j, k]
            out[i, j] = s


@compiled
def factor(A: Array) -> bool:
    """A (n, n), symmetric, becomes its lower Cholesky factor; False where it is not positive definite."""
    n = A.shape[0]
    for j in range(n):
        s = A[j, j]
        for k in range(j):
            s -= A[j, k] * A[j, k]
        if not s > DEPENDENT * A[j, j]:
            return False
        A[j, j] = math.sqrt(s)
        for i in range(j + 1, n):  # column by column: these do not wait for each other
            s = A[i, j]
            for k in range(j):
                s -= A[i, k] * A[j, k]
            A[i, j] = s / A[j, j]
    return True


@compiled
def back_substitute(L: Array, x: Array) -> None:
    """X (n,) becomes (L L^T)^-1 x, with L from `factor`."""
    n = L.shape[0]
    for i in range(n):
        s = x[i]
        for k in range(i):
            s -= L[i, k] * x[k]
        x[i] = s / L[i, i]
    for i in range(n - 1, -1, -1):
        s = x[i]
        for k in range(i + 1, n):
            s -= L[k, i] * x[k]
        x[i] = s / L[i, i]


@compiled
def back_substitute_rows(L: Array, X: Array) -> None:
    """Every row of X (m, n) becomes (L L^T)^-1 times it; they go side by side, since none waits."""
    n, m = L.shape[0], X.shape[0]
    for i in range(n):
        for row in range(m):
            s = X[row, i]
            for k in range(i):
                s -= L[i, k] * X[row, k]
            X[row, i] = s / L[i, i]
    for i in range(n - 1, -1, -1):
        for row in range(m):
            s = X[row, i]
            for k in range(i + 1, n):
                s -= L[k, i] * X[row, k]
            X[row, i] = s / L[i, i]


@compiled
def eliminate(A: Array, b: Array) -> bool:
    """B (n,) becomes A^-1 b by Gauss with row pivots; A is spent. False where A is singular."""
    n = A.shape[0]
    for k in range(n):
        p = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[p, k]):
                p = i
        if A[p, k] == 0.0:
            return False
        if p != k:
            for j in range(k, n):
                A[k, j], A[p, j] = A[p, j], A[k, j]
            b[k], b[p] = b[p], b[k]
        for i in range(k + 1, n):
            c = A[i, k] / A[k, k]
            if c != 0.0:
                for j in range(k + 1, n):
                    A[i, j] -= c * A[k, j]
                b[i] -= c * b[k]
    for i in range(n - 1, -1, -1):
        s = b[i]
        for j in range(i + 1, n):
            s -= A[i, j] * b[j]
        b[i] = s / A[i, i]
    return True


@compiled
def nearest(J: Array, v: Array, wanted: Array, out: Array) -> bool:
    """Out = the solution of J x = v nearest to `wanted` (n,): wanted + J^T (J J^T)^-1 (v - J wanted).

    False where J (m, n) has lost rank. `out` may be `wanted`.
    """
    m = J.shape[0]
    A, gap = scratch_matrix(m, m), scratch(m)
    outer_product(J, J, A)
    if not factor(A):
        return False
    times(J, wanted, gap)
    for i in range(m):
        gap[i] = v[i] - gap[i]
    back_substitute(A, gap)
    for j in range(out.size):
        s = wanted[j]
        for i in range(m):
            s += J[i, j] * gap[i]
        out[j] = s
    return True


@compiled
def determinant(A: Array) -> float:
    """Determinant of A (n, n) by Gauss with row pivots; A is spent."""
    n = A.shape[0]
    product = 1.0
    for k in range(n):
        p = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[p, k]):
                p = i
        if A[p, k] == 0.0:
            return 0.0
        if p != k:
            product = -product
            for j in range(k, n):
                A[k, j], A[p, j] = A[p, j], A[k, j]
        product *= A[k, k]
        for i in range(k + 1, n):
            c = A[i, k] / A[k, k]
            for j in range(k + 1, n):
                A[i, j] -= c * A[k, j]
    return product


@compiled
def null_space(J: Array, Z: Array) -> None:
    """Rows of Z (n - m, n) = an orthonormal basis of the null space of J (m, n): Householder's reflections.

    H_m .. H_1 J^T = (R; 0), and Z^T = H_1 .. H_m (0; I). Whatever the rank of J, Z's rows are orthonormal.
    """
    m, n = J.shape
    U, beta = J.copy(), np.zeros(m)
    for i in range(m):
        rest = 0.0
        for k in range(i + 1, n):
            rest += U[i, k] * U[i, k]
        if rest == 0.0:
            continue
        end = -math.copysign(math.sqrt(U[i, i] * U[i, i] + rest), U[i, i])
        beta[i] = (end - U[i, i]) / end
        scale = 1.0 / (U[i, i] - end)
        for k in range(i + 1, n):
            U[i, k] *= scale
        U[i, i] = 1.0
        for j in range(i + 1, m):
            _reflect(U, beta[i], i, U, j)
    for k in range(n - m):
        for j in range(n):
            Z[k, j] = 1.0 if j == m + k else 0.0
        for i in range(m - 1, -1, -1):
            _reflect(U, beta[i], i, Z, k)


@compiled
def _reflect(U: Array, beta: float, i: int, X: Array, row: int) -> None:
    """The row of X becomes (I - beta u u^T) times it, with u the row i of U from its diagonal on."""
    s = 0.0
    for k in range(i, X.shape[1]):
        s += U[i, k] * X[row, k]
    s *= beta
    for k in range(i, X.shape[1]):
        X[row, k] -= s * U[i, k]


@compiled
def diagonalise(A: Array, V: Array) -> None:
    """A (n, n), symmetric, becomes V^T A V, diagonal, with the eigenvectors as V's columns: Jacobi."""
    n = A.shape[0]
    for i in range(n):
        for j in range(n):
            V[i, j] = 1.0 if i == j else 0.0
    for _ in range(_SWEEPS):
        off = whole = 0.0
        for i in range(n):
            whole += A[i, i] * A[i, i]
            for j in range(i):
                off += A[i, j] * A[i, j]
        if not off > 1e-32 * whole:
            return
        for p in range(n):
            for q in range(p + 1, n):
                _rotate(A, V, p, q)


@compiled
def _rotate(A: Array, V: Array, p: int, q: int) -> None:
    """Jacobi's rotation that makes A[p, q] zero."""
    if A[p, q] == 0.0:
        return
    ratio = 0.5 * (A[q, q] - A[p, p]) / A[p, q]
    t = math.copysign(1.0, ratio) / (abs(ratio) + math.sqrt(ratio * ratio + 1.0))
    c = 1.0 / math.sqrt(t * t + 1.0)
    s = t * c
    for k in range(A.shape[0]):
        A[k, p], A[k, q] = c * A[k, p] - s * A[k, q], s * A[k, p] + c * A[k, q]
    for k in range(A.shape[0]):
        A[p, k], A[q, k] = c * A[p, k] - s * A[q, k], s * A[p, k] + c * A[q, k]
        V[k, p], V[k, q] = c * V[k, p] - s * V[k, q], s * V[k, p] + c * V[k, q]
