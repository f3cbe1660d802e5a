"""Constraint-consistent control: the RCM as a constraint that moves, projected inverse dynamics."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.control.torque_laws.base import KernelTorqueLaw
from surgsim.control.torque_laws.rcm_tasks import OWN_GAINS, RcmTasksConfig, wanted
from surgsim.models.arm import ArmModel
from surgsim.tick.algebra import (
    back_substitute,
    dot,
    factor,
    nearest,
    null_space,
    outer_product,
    times,
    transposed_times,
)
from surgsim.tick.arrays import Seen
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.status import GOES_ON, RANK_LOST

Share = Annotated[float, Field(ge=0.0, le=1.0)]
MOTION_SHARE, BIAS_SHARE = OWN_GAINS, OWN_GAINS + 1
"""Places of the gains that are this law's own."""
TIP, POSTURE, FREE_BIAS, CONSTRAINT, CONSTRAINT_BIAS = range(5)
"""Rows of the terms: the first three are tau_f, the last two tau_c."""
TERMS = ("tip", "posture", "free_bias", "constraint", "constraint_bias")


class ConstraintConsistentConfig(RcmTasksConfig):
    """Projected inverse dynamics: a torque of free motion, and one of the RCM's constraint.

    Attributes:
        constraint_share: Share of the constraint torque (I - P) M q'' that the law applies: with 1 the RCM is
            virtual, with 0 a port has to carry it.
        constraint_bias_share: The same of (I - P) h: gravity, Coriolis, centrifugal and damping torque that
            act on the constraint.
    """

    type: Literal["constraint_consistent"] = "constraint_consistent"
    constraint_share: Share = 1.0
    constraint_bias_share: Share = 1.0

    def build(self, arm: ArmModel) -> KernelTorqueLaw:
        """The law, without memory."""
        gains = [*self.task_gains(), self.constraint_share, self.constraint_bias_share]
        return KernelTorqueLaw(
            kernel=constraint_consistent, arm=arm, terms=TERMS, gains=np.array(gains, dtype=np.float64)
        )


@compiled
def constraint_consistent(gains: Array, seen: Seen, memory: Array, out: Array) -> int:
    """Tau = tau_f + s tau_c; rows tip, posture, free_bias (tau_f), constraint, constraint_bias (tau_c) [N m].

    The constraint Phi(q, t) = (I - z z^T)(p_c(t) - p(q)) = 0 gives A q'' = c, with A = J_rcm and c as in
    `wanted`. With P = I - A^+ A and M_c = P M + I - P the constrained arm moves as
    q'' = M_c^-1 (P (tau - h) + A^+ c), and

        Lambda = (J M_c^-1 P J^T)^-1,  F = Lambda (a - J M_c^-1 A^+ c + J M_c^-1 P h),  a = x'' - J' q'
        tau_f  = P (J^T F + N_t tau_0),  N_t = I - J^T Lambda J M_c^-1 P,  tau_0 = M q''_0 + h
        tau_c  = (I - P)(M q'' + h)

    where M_c^-1 P = Z^T (Z M Z^T)^-1 Z and M_c^-1 A^+ c = (I - M_c^-1 P M) A^+ c, with the rows of Z an
    orthonormal basis of A's null space: so it is computed. h is kept out of F and tau_0, where it cancels to
    P h, and has rows of its own.

    Source: Li, Sadeghian, Yang, Le Mesle, Haddadin, "RCM Constraint-Consistent Dynamic Control in Surgical
    Robots", arXiv 2509.14075: the constraint and the split are theirs. Their equations were not at hand; the
    form is that of Aghili (2005) and Mistry and Righetti (2011), see the law's page.
    """
    n, m = seen.q.size, 3 + seen.rows
    J, a, posture, h = scratch_matrix(m, n), scratch(m), scratch(n), scratch(n)
    wanted(gains, seen, J, a, posture, h)
    Z, L = scratch_matrix(n - m + 3, n), scratch_matrix(n - m + 3, n - m + 3)
    null_space(J[3:], Z)
    MZ = scratch_matrix(n - m + 3, n)
    outer_product(Z, seen.M, MZ)
    outer_product(MZ, Z, L)
    if not factor(L):
        return RANK_LOST
    qddot, torque = scratch(n), scratch(n)
    if not _constrained_acceleration(J[3:], a[3:], seen.M, Z, L, qddot):
        return RANK_LOST
    if not _free_torques(J[:3], a[:3], posture, seen.M, Z, L, qddot, out):
        return RANK_LOST
    for i in range(n):
        torque[i] = out[TIP, i] + out[POSTURE, i]
    _give_motion(Z, L, torque, qddot)
    times(seen.M, qddot, out[CONSTRAINT])
    out[CONSTRAINT_BIAS], out[FREE_BIAS] = h, h
    _project(Z, out[TIP])
    _project(Z, out[POSTURE])
    _project(Z, out[FREE_BIAS])
    torque[:] = out[CONSTRAINT]
    _project(Z, torque)
    for i in range(n):
        out[CONSTRAINT, i] = gains[MOTION_SHARE] * (out[CONSTRAINT, i] - torque[i])
        out[CONSTRAINT_BIAS, i] = gains[BIAS_SHARE] * (h[i] - out[FREE_BIAS, i])
    return GOES_ON


@compiled
def _constrained_acceleration(A: Array, c: Array, M: Array, Z: Array, L: Array, out: Array) -> bool:
    """Out = M_c^-1 A^+ c (n,), with L the Cholesky factor of Z M Z^T; False where A has lost rank."""
    force = scratch(out.size)
    out[:] = 0.0
    if c.size > 0 and not nearest(A, c, out, out):
        return False
    times(M, out, force)
    for i in range(out.size):
        force[i] = -force[i]
    _give_motion(Z, L, force, out)
    return True


@compiled
def _give_motion(Z: Array, L: Array, torque: Array, qddot: Array) -> None:
    """Add M_c^-1 P torque (n,) to qddot (n,)."""
    along = scratch(L.shape[0])
    times(Z, torque, along)
    back_substitute(L, along)
    for k in range(along.size):
        for j in range(qddot.size):
            qddot[j] += Z[k, j] * along[k]


@compiled
def _free_torques(
    J: Array, a: Array, posture: Array, M: Array, Z: Array, L: Array, given: Array, out: Array
) -> bool:
    """Fill the rows of tip and posture, not yet projected; False where the tip cannot move at will.

    Args:
        J: Tip Jacobian (3, n).
        a: x'' - J' q' (3,) [m/s^2].
        posture: q''_0 (n,) [rad/s^2].
        M: Inertia (n, n).
        Z: Basis of the constraint's null space (n - 2, n).
        L: Cholesky factor of Z M Z^T.
        given: M_c^-1 A^+ c (n,) [rad/s^2].
        out: Terms.
    """
    n = posture.size
    moved, mobility, force = scratch_matrix(3, n), scratch_matrix(3, 3), scratch(3)
    moved[:] = 0.0
    for i in range(3):
        _give_motion(Z, L, J[i], moved[i])
    outer_product(moved, J, mobility)
    if not factor(mobility):
        return False
    for i in range(3):
        force[i] = a[i] - dot(J[i], given)
    back_substitute(mobility, force)
    transposed_times(J, force, out[TIP])
    times(M, posture, out[POSTURE])
    times(moved, out[POSTURE], force)
    back_substitute(mobility, force)
    for i in range(3):
        for j in range(n):
            out[POSTURE, j] -= J[i, j] * force[i]
    return True


@compiled
def _project(Z: Array, torque: Array) -> None:
    """The torque (n,) becomes P torque = Z^T Z torque."""
    along = scratch(Z.shape[0])
    times(Z, torque, along)
    transposed_times(Z, along, torque)
