"""RNN: the dynamic neural network of Jin et al. for manipulability optimisation."""

import math
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.control.manipulability import fill_diamond
from surgsim.control.resolvers.base import KernelResolver
from surgsim.control.resolvers.rows import answer, fill_task_rows
from surgsim.models.arm import ArmModel
from surgsim.tick.algebra import back_substitute_rows, factor, outer_product, times, transposed_times
from surgsim.tick.arrays import Resolved, Seen
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.status import DIVERGED, GOES_ON, RANK_LOST

_DIVERGED = 1e12


class RnnConfig(PartConfig):
    """Dynamic neural network that solves the manipulability QP by gradient flow.

    The defaults are Table I of the VPRNN paper, with c3 = h0, c2 = h1, c0 = h2, c1 = h4, epsilon = 1 / beta.

    Attributes:
        c0: Weight of the task row's least-squares term.
        c1: Weight of the least-squares term of phi = vec((J J^T)^-1).
        c2: Weight of the joint-velocity norm.
        c3: Weight of the manipulability gradient.
        epsilon_s: Time constant of the network [s].
        k_tip: Tip feedback gain [1/s].
        k_rcm: RCM feedback gain [1/s].
        rcm: Whether the RCM rows are stacked below the tip rows.
        form: `corrected` follows from the gradient of the Lagrangian; `printed` has the signs of eq. (7).
        step_over_epsilon: Integration step of the network, in time constants.
    """

    shares_null_space: ClassVar[bool] = True
    type: Literal["rnn"] = "rnn"
    c0: NonNegativeFloat = 1.0
    c1: NonNegativeFloat = 1.0
    c2: PositiveFloat = 0.01
    c3: NonNegativeFloat = 0.01
    epsilon_s: Annotated[float, Field(ge=1e-6)] = 1e-3
    k_tip: NonNegativeFloat = 5.0
    k_rcm: NonNegativeFloat = 5.0
    rcm: bool = True
    form: Literal["corrected", "printed"] = "corrected"
    step_over_epsilon: Annotated[float, Field(gt=0.0, le=1.0)] = 0.05

    def build(self, arm: ArmModel) -> KernelResolver:
        """The resolver; memory omega (n,), phi (9,), sigma (9,), lam (r,), the states of eq. (6)-(9)."""
        gains = np.array(
            [
                self.c0,
                self.c1,
                self.c2,
                self.c3,
                self.epsilon_s,
                self.k_tip,
                self.k_rcm,
                self.rcm,
                1.0 if self.form == "corrected" else -1.0,
                self.step_over_epsilon,
            ],
            dtype=np.float64,
        )
        return KernelResolver(
            kernel=rnn,
            arm=arm,
            gains=gains,
            memory_size=arm.limits.q_min.size + 23,
            failures={DIVERGED: f"RNN ({self.form} form): a neural state exceeds 1e12"},
        )


@compiled
def rnn(gains: Array, seen: Seen, memory: Array, out: Resolved) -> int:
    """The network of eq. (6)-(9) of the manipulability paper, with D = J <> H and B = I x J J^T.

        eps omega'  = -omega + P_Omega[c3 D phi - c0 J_a^T (J_a omega - v) + (1 - c2) omega - J_a^T lam]
        eps phi'    = +c3 D^T omega + B sigma - c1 B (B phi - vec I)
        eps lam'    = J_a omega - v
        eps sigma'  = vec I - B phi

    Eq. (7) is printed with the signs of the c3 and c1 terms flipped, which is unstable. J_a is J_T, or
    [J_T; J_rcm]. The command is the mean of omega over the period, so that without feedback the integrated
    tip error is exactly eps (lam - lam(0)). In the steady state omega = pinv(J_a) v + (c3/c2) N grad(ln mu).

    The network starts at omega = 0, phi = vec((J J^T)^-1), lam = 0, sigma = 0. It is stepped by explicit
    Euler over a whole number of steps a period.
    """
    n = seen.q.size
    omega, phi, sigma, lam = memory[:n], memory[n : n + 9], memory[n + 9 : n + 18], memory[n + 18 :]
    A = scratch_matrix(3, 3)
    outer_product(seen.Jv_WT, seen.Jv_WT, A)
    if seen.first != 0 and not _inverse(A, phi):
        return RANK_LOST
    m = 3 + (seen.rows if gains[7] != 0.0 else 0)
    J, v, D, mean = scratch_matrix(m, n), scratch(m), scratch_matrix(n, 9), scratch(n)
    fill_task_rows(seen, gains[5], gains[6], J, v)
    fill_diamond(seen.Jv_WT, seen.z_W, D)
    substeps = math.ceil(seen.dt_s / (gains[9] * gains[4]) - 1e-9)
    h = seen.dt_s / substeps / gains[4]
    mean[:] = 0.0
    _flow(gains, seen, J, v, D, A, omega, phi, sigma, lam[: v.size], h, substeps, mean)
    for i in range(9):
        if not (abs(phi[i]) < _DIVERGED and abs(sigma[i]) < _DIVERGED):
            return DIVERGED
    answer(seen, mean, J, v, out)
    return GOES_ON


@compiled
def _inverse(A: Array, out: Array) -> bool:
    """Out (9,) = vec(A^-1) of a symmetric A (3, 3); False where it is singular."""
    L, X = scratch_matrix(3, 3), scratch_matrix(3, 3)
    L[:] = A
    if not factor(L):
        return False
    for i in range(3):
        for j in range(3):
            X[i, j] = 1.0 if i == j else 0.0
    back_substitute_rows(L, X)
    for i in range(3):
        for j in range(3):
            out[3 * i + j] = X[i, j]
    return True


@compiled
def _block_times(A: Array, x: Array, out: Array) -> None:
    """Out (9,) = (I x A) x for a symmetric A (3, 3)."""
    for i in range(3):
        for j in range(3):
            s = 0.0
            for k in range(3):
                s += x[3 * i + k] * A[k, j]
            out[3 * i + j] = s


@compiled
def _flow(
    gains: Array,
    seen: Seen,
    J: Array,
    v: Array,
    D: Array,
    A: Array,
    omega: Array,
    phi: Array,
    sigma: Array,
    lam: Array,
    h: float,
    substeps: int,
    mean: Array,
) -> None:
    """`substeps` explicit Euler steps of length `h` time constants; `mean` is that of omega over them."""
    c0, c1, c2, c3, sign = gains[0], gains[1], gains[2], gains[3], gains[8]
    n, m = omega.size, v.size
    gap, pull, inside, climb = scratch(m), scratch(m), scratch(n), scratch(n)
    B_phi, B_gap, B_sigma, turned = scratch(9), scratch(9), scratch(9), scratch(9)
    for _ in range(substeps):
        times(J, omega, gap)
        for i in range(m):
            gap[i] -= v[i]
            pull[i] = c0 * gap[i] + lam[i]
        _block_times(A, phi, B_phi)
        for i in range(3):
            B_phi[4 * i] -= 1.0
        _block_times(A, B_phi, B_gap)
        _block_times(A, sigma, B_sigma)
        times(D, phi, climb)
        transposed_times(D, omega, turned)
        transposed_times(J, pull, inside)
        for j in range(n):
            mean[j] += omega[j] / substeps
            wanted = c3 * climb[j] - inside[j] + (1.0 - c2) * omega[j]
            omega[j] += h * (min(max(wanted, seen.lower[j]), seen.upper[j]) - omega[j])
        for i in range(9):
            phi[i] += h * (sign * (c3 * turned[i] - c1 * B_gap[i]) + B_sigma[i])
            sigma[i] -= h * B_phi[i]
        for i in range(m):
            lam[i] += h * gap[i]
