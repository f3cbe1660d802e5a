"""The VPRNN's linear system of one instant, eq. (25), from the kernels of the resolver: to study it alone."""

import numpy as np

from surgsim.array import Array
from surgsim.control.manipulability import diamond, jacobian_gradient
from surgsim.control.problem import VelocityProblem
from surgsim.control.resolvers.vprnn import (
    BETA,
    BOUND,
    CAP,
    VprnnConfig,
    decay,
    exponential_integral,
    fill_network_rows,
    network_size,
    recover_qdot,
    right_side,
    system,
)
from surgsim.control.seen import seen_of_velocity
from surgsim.models.arm import ArmModel


class Network:
    """W z = l of eq. (25) for a problem that stands still, from the kernels of the resolver itself.

    Args:
        config: Gains.
        arm: The nominal arm.
        problem: The problem.

    Attributes:
        W: (n + 18 + m) square, for z = [q', psi, lambda1, lambda2, lambda3].
        l: (n + 18 + m,).
    """

    def __init__(self, config: VprnnConfig, arm: ArmModel, problem: VelocityProblem) -> None:
        self.resolver = config.build(arm)
        seen, self._gains = seen_of_velocity(problem, arm), self.resolver.gains
        m = network_size(self._gains, seen)
        self._J, v = np.empty((m, seen.q.size)), np.empty(m)
        fill_network_rows(self._gains, seen, self._J, v)
        Jv = problem.kin.Jv_WT
        self._A = np.ascontiguousarray(Jv @ Jv.T)
        self._Jv, self._z_W = Jv, problem.kin.z_W
        D = diamond(Jv, jacobian_gradient(Jv, problem.kin.z_W))
        self.W: Array = system(self._gains, self._J, self._A, D)
        self.l: Array = np.zeros(len(self.W))
        right_side(self._gains, self._J, v, self._A, self.l)

    def decay(self, delta: Array, t_s: float, dt_s: float) -> Array:
        """The error delta after one period, eq. (27) in closed form."""
        return decayed(self._gains, delta, t_s, dt_s)

    def velocity(self, delta: Array) -> Array:
        """Joint velocity q' (n,) of W z = l + delta.

        Raises:
            numpy.linalg.LinAlgError: If W is singular.
        """
        qdot = np.zeros(self._J.shape[1])
        if not recover_qdot(self._gains, self._Jv, self._z_W, self._J, self._A, self.l + delta, qdot):
            raise np.linalg.LinAlgError("W is singular")
        return qdot


def decayed(gains: Array, delta: Array, t_s: float, dt_s: float) -> Array:
    """The error delta after one period from `t_s` [s], with a VPRNN's `gains`."""
    out = np.array(delta, dtype=float)
    integral = exponential_integral(float(t_s), float(t_s + dt_s), gains[CAP])
    decay(out, gains[BETA] * integral, gains[BOUND])
    return out
