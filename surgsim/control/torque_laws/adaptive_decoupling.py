"""Adaptive decoupling: tip, RCM in its null space, posture in that of both, and a network that learns."""

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.control.torque_laws.base import KernelTorqueLaw
from surgsim.control.torque_laws.decoupled import decouple
from surgsim.control.torque_laws.rcm_hierarchy import (
    D_JOINT,
    D_RCM,
    D_TIP,
    K_JOINT,
    K_RCM,
    K_TIP,
    fill_task_errors,
)
from surgsim.control.torque_laws.rcm_tasks import OWN_GAINS, RcmTasksConfig, fill_bias
from surgsim.models.arm import ArmModel
from surgsim.tick.algebra import back_substitute, factor
from surgsim.tick.arrays import Seen
from surgsim.tick.nominal import copy_model
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.status import GOES_ON, RANK_LOST

ADAPTATION, LEAKAGE, NODES, SLOWEST, RATIO = range(OWN_GAINS, OWN_GAINS + 5)
"""Places of the gains that are this law's own."""
TIP, RCM, JOINT, BIAS, LEARNT = range(5)
"""Rows of the terms."""


class AdaptiveDecouplingConfig(RcmTasksConfig):
    """Decoupled compliance of tip, RCM and posture, with a radial-basis network for what the model lacks.

    Attributes:
        adaptation_per_s2: g, how fast the weights are learnt, per unit mass [1/s^2]; 0: not at all.
        leakage_per_s: n, how fast weights decay that nothing upholds: sigma modification [1/s].
        nodes: Basis functions of each joint.
        slowest_rad_per_s: Joint velocity below which the network sees no detail [rad/s].
        fastest_over_slowest: Joint velocity of the outermost nodes, over the slowest.
        drive_share: On elastic drives all bandwidths, sqrt(g) too, are at most this share of the lowest
            sqrt(K / B_s).
        drive_damping_ratio: Damping of RCM and tip where that bounds their bandwidth.
    """

    type: Literal["adaptive_decoupling"] = "adaptive_decoupling"
    adaptation_per_s2: NonNegativeFloat = 1000.0
    leakage_per_s: NonNegativeFloat = 0.05
    nodes: Annotated[int, Field(ge=1, le=50)] = 7
    slowest_rad_per_s: PositiveFloat = 0.005
    fastest_over_slowest: Annotated[float, Field(ge=2.0, le=1e5)] = 100.0
    drive_share: PositiveFloat = 0.25
    drive_damping_ratio: PositiveFloat = 0.5

    def build(self, arm: ArmModel) -> KernelTorqueLaw:
        """The law; memory: weights, joint by joint (n * nodes,), and the inertia of each joint (n,)."""
        n, fastest = arm.limits.torque.size, self.drive_share * arm.locked_frequency
        gains = [
            *self.bounded_gains(fastest, self.drive_damping_ratio),
            min(self.adaptation_per_s2, fastest**2),
            self.leakage_per_s,
            self.nodes,
            self.slowest_rad_per_s,
            self.fastest_over_slowest,
        ]
        return KernelTorqueLaw(
            kernel=adaptive_decoupling,
            arm=arm,
            terms=("tip", "rcm", "joint", "bias", "learnt"),
            gains=np.array(gains, dtype=np.float64),
            memory_size=n * (self.nodes + 1),
        )


@compiled
def adaptive_decoupling(gains: Array, seen: Seen, memory: Array, out: Array) -> int:
    """Tau = J' F + N_1 A' F_N + N_2 tau_J + h + W' phi(z); rows tip, rcm, joint, bias, learnt (5, n) [N m].

        F, F_N, tau_J:  J q'' = -b - d e' - k e of tip and RCM, q''_0 of the posture, in `decouple`
        s = q' - q'_r:  the joint velocity for which J s = e' + (k/d) e of tip and RCM, and of the posture's
                        s_0 = q' - q_ref' + (k/d)(q - q_ref) the rest
        w_i' = -g m_i s_i phi(z_i) - n w_i,  tau_learnt,i = w_i . phi(z_i),  z_i = asinh(q_ref,i' / v_0)

    w_i are the weights of joint i, phi Gaussians at `nodes` places from -asinh(v_1/v_0) to asinh(v_1/v_0), as
    wide as they are apart, divided by their sum: constant torques, of weights that are all equal, and dry
    friction, which changes at z = 0, are both within reach. m_i is the diagonal of the inertia at the first
    tick.

    With l = k/d each row moves as s' = -(d - l) s - l^2 e + (what is not learnt). Let x be the joint
    displacement that gives l e as s gives its rows, and w_i* . phi the torque that the model lacks. Then
    s' M s + x' M x + (sum over i of |w_i - w_i*|^2 / (g m_i)) falls, but for leakage and a changing M.

    Source: the sum, tip before RCM before posture and an adaptive term of a network with
    W' = -Gamma (phi s' + kappa W), is recalled of the decoupling controllers of Sandoval, Vieyres and Poisson
    (2017), and Su et al. (2019, 2020), whose equations were not seen: it is [10] of the VPRNN paper that says
    no more than "adaptive decoupling impedance controller". Sigma modification: Ioannou and Kokotovic (1984).
    Ours: the effective masses of `decouple`, s, z, phi, Gamma = g m_i, kappa = n / Gamma.
    """
    n, m, model = seen.q.size, 3 + seen.rows, seen.elsewhere
    copy_model(seen, model)
    J, a, posture, sliding = scratch_matrix(m, n), scratch(m), scratch(n), scratch(n)
    error, rate, bias = scratch(m), scratch(m), scratch(m)
    fill_task_errors(seen, model, 0.0, 0.0, J, error, rate, bias)
    _surfaces(gains, seen, error, rate, a, posture)
    if not _joint_velocity(seen.M, J, a, posture, sliding):
        return RANK_LOST
    for i in range(m):
        stiffness, damping = (gains[K_TIP], gains[D_TIP]) if i < 3 else (gains[K_RCM], gains[D_RCM])
        a[i] = -bias[i] - stiffness * error[i] - damping * rate[i]
    for i in range(n):
        turning = seen.v[i] - seen.qdot_ref[i]
        posture[i] = -gains[K_JOINT] * (seen.q[i] - seen.q_ref[i]) - gains[D_JOINT] * turning
    fill_bias(seen, out[BIAS])
    if not decouple(seen.M, J[:3], a[:3], J[3:], a[3:], posture, out[:3]):
        return RANK_LOST
    _learn(gains, seen, sliding, memory, out[LEARNT])
    return GOES_ON


@compiled
def _surfaces(gains: Array, seen: Seen, error: Array, rate: Array, s: Array, posture: Array) -> None:
    """Fill e' + (k/d) e of tip and RCM (m,) [m/s], and of the posture (n,) [rad/s]."""
    for i in range(s.size):
        slope = _slope(gains[K_TIP], gains[D_TIP]) if i < 3 else _slope(gains[K_RCM], gains[D_RCM])
        s[i] = rate[i] + slope * error[i]
    slope = _slope(gains[K_JOINT], gains[D_JOINT])
    for i in range(posture.size):
        posture[i] = seen.v[i] - seen.qdot_ref[i] + slope * (seen.q[i] - seen.q_ref[i])


@compiled
def _slope(stiffness: float, damping: float) -> float:
    """K/d [1/s], 0 without damping."""
    return stiffness / damping if damping > 0.0 else 0.0


@compiled
def _joint_velocity(M: Array, J: Array, s: Array, posture: Array, out: Array) -> bool:
    """The joint velocity (n,) for which J out = s, nearest to `posture` by the inertia; False without one."""
    n = posture.size
    torques, L = scratch_matrix(3, n), scratch_matrix(n, n)
    L[:] = M
    if not (factor(L) and decouple(M, J[:3], s[:3], J[3:], s[3:], posture, torques)):
        return False
    for i in range(n):
        out[i] = torques[0, i] + torques[1, i] + torques[2, i]
    back_substitute(L, out)
    return True


@compiled
def _learn(gains: Array, seen: Seen, s: Array, memory: Array, torque: Array) -> None:
    """Fill the network's torque (n,) [N m], and move its weights over a control period."""
    n, nodes, dt = seen.q.size, int(gains[NODES]), seen.dt_s
    weights, inertia, share = memory[: n * nodes].reshape((n, nodes)), memory[n * nodes :], scratch(nodes)
    for i in range(n):
        if seen.first != 0:
            inertia[i] = seen.M[i, i]
        fill_basis(seen.qdot_ref[i], gains[SLOWEST], gains[RATIO], share)
        torque[i] = 0.0
        for k in range(nodes):
            torque[i] += weights[i, k] * share[k]
            pull = gains[ADAPTATION] * inertia[i] * s[i] * share[k]
            weights[i, k] -= dt * (pull + gains[LEAKAGE] * weights[i, k])


@compiled
def fill_basis(velocity: float, slowest: float, ratio: float, out: Array) -> None:
    """Fill phi (nodes,), whose sum is 1, at a joint velocity [rad/s]."""
    z, end, total = math.asinh(velocity / slowest), math.asinh(ratio), 0.0
    apart = 2.0 * end / max(out.size - 1, 1)
    z = min(max(z, -end), end)
    for k in range(out.size):
        x = (z + end - k * apart) / apart
        out[k] = math.exp(-0.5 * x * x)
        total += out[k]
    for k in range(out.size):
        out[k] /= total
