"""VPRNN: the varying-parameter recurrent neural network of the hierarchical-control paper (eq. 5-29)."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, NonNegativeFloat, PositiveFloat

from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.control.manipulability import diamond, jacobian_gradient
from surgsim.control.problem import ControlFailure, Resolution, VelocityProblem, bounded_resolution
from surgsim.control.rcm import rcm_cross_form
from surgsim.errors import Outcome
from surgsim.linalg import solve
from surgsim.models.arm import ArmModel
from surgsim.spatial import cross

Array = NDArray[np.float64]
_DIVERGED = 1e12
_NO_ROWS = np.zeros((0, 7))


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

    def build(self, arm: ArmModel) -> "Vprnn":
        """The resolver."""
        return Vprnn(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class VprnnMemory:
    """State of the network.

    Attributes:
        delta: Error W z - l of eq. (26) (29,); None before the first exact step.
        z: Decision vector [q', psi, lambda1, lambda2, lambda3], kept by the Euler form alone.
        W: W of the step before, kept by the Euler form alone.
        l: l of the step before, kept by the Euler form alone.
    """

    delta: Array | None = None
    z: Array | None = None
    W: Array | None = None
    l: Array | None = None  # noqa: E741 - the paper's name


@dataclass(frozen=True, slots=True, kw_only=True)
class Terms:
    """Building blocks of W and l at one state.

    Attributes:
        J: Tip Jacobian J_T (3, 7).
        J_rcm: RCM rows (r, 7), r = 2, 3 or 0.
        D: J_T <> h (7, 9) of eq. (18).
        A: J_T J_T^T (3, 3).
        v_d: Right side of the tip rows (3,), eq. (20).
        v_rcm: Right side of the RCM rows (r,).
    """

    J: Array
    J_rcm: Array
    D: Array
    A: Array
    v_d: Array
    v_rcm: Array


class Vprnn:
    """Solves W z = l, eq. (25), through the error dynamics delta' = -beta exp(t) phi(delta), eq. (27).

    In the exact form delta is stepped in closed form, saturated range included, and z follows from
    W z = l + delta. W is block-structured: psi comes from (I x J J^T) psi = vec(I) + delta_5, and
    [q', lambda1, lambda2] from a KKT system of 12 rows; lambda3 does not feed back and is not needed.
    z starts at zero, so delta starts at -l.

    Source: VPRNN paper, section III; eq. (20), (21), (25)-(29). A cap on exp(t) and the projection on two
    RCM rows are ours: the paper's W is singular with the three cross-product rows.
    """

    def __init__(self, config: VprnnConfig) -> None:
        self._c = config
        self._bound = math.inf if config.activation_bound is None else config.activation_bound
        self._solve = _rank_revealing_solve if config.rcm_rows == "cross" else solve

    def start(self, problem: VelocityProblem) -> VprnnMemory:
        """Memory with z = 0."""
        return VprnnMemory()

    def step(self, problem: VelocityProblem, memory: VprnnMemory) -> tuple[Resolution, VprnnMemory]:
        """One control period of the network, and its joint velocities projected on Omega."""
        J_rcm, v_d, v_rcm = self._rows(problem)
        J = np.concatenate((problem.kin.Jv_WT, J_rcm))
        if self._c.integration == "exact":
            qdot, memory = self._step_exact(problem, J, v_d, v_rcm, memory)
        else:
            qdot, memory = self._step_euler(self.terms(problem), problem, memory)
        if not np.abs(qdot).max() < _DIVERGED:
            raise ControlFailure(Outcome.DIVERGED, "VPRNN: a joint velocity exceeds 1e12 rad/s")
        return bounded_resolution(problem, qdot, J, np.concatenate((v_d, v_rcm))), memory

    def _rows(self, problem: VelocityProblem) -> tuple[Array, Array, Array]:
        """J_rcm (r, 7), v_d (3,) and v_rcm (r,) of eq. (20)."""
        v_d = problem.command.v_WTd - self._c.k1 * problem.tip_error
        if problem.rcm is None:
            return _NO_ROWS, v_d, _NO_ROWS[:, 0]
        if self._c.rcm_rows == "cross":
            error, J_rcm = rcm_cross_form(problem.kin, problem.p_WC)
            return J_rcm, v_d, cross(problem.kin.R_WT[:, 2], problem.v_WC) - self._c.k2 * error
        return problem.rcm.jacobian, v_d, problem.rcm.trocar_velocity - self._c.k2 * problem.rcm.error

    def terms(self, problem: VelocityProblem) -> Terms:
        """Building blocks of W and l."""
        J = problem.kin.Jv_WT
        J_rcm, v_d, v_rcm = self._rows(problem)
        D = diamond(J, jacobian_gradient(J, problem.kin.z_W))
        return Terms(J=J, J_rcm=J_rcm, D=D, A=J @ J.T, v_d=v_d, v_rcm=v_rcm)

    def system(self, t: Terms) -> tuple[Array, Array]:
        """W (7 + 18 + 3 + r) square and l of eq. (25)."""
        c, r = self._c, t.J_rcm.shape[0]
        B = np.kron(np.eye(3), t.A)
        n = 28 + r
        q, psi, l1, l2, l3 = slice(0, 7), slice(7, 16), slice(16, 19), slice(19, 19 + r), slice(19 + r, n)
        W, l = np.zeros((n, n)), np.zeros(n)  # noqa: E741
        W[q, q] = c.h1 * np.eye(7) + c.h2 * t.J.T @ t.J + c.h3 * t.J_rcm.T @ t.J_rcm
        W[q, psi], W[q, l1], W[q, l2] = -c.h0 * t.D, -t.J.T, -t.J_rcm.T
        W[psi, q], W[psi, psi], W[psi, l3] = -c.h0 * t.D.T, c.h4 * B @ B, -B
        W[l1, q], W[l2, q], W[l3, psi] = t.J, t.J_rcm, B
        l[q] = c.h2 * t.J.T @ t.v_d + c.h3 * t.J_rcm.T @ t.v_rcm
        l[psi] = c.h4 * B @ np.eye(3).ravel()
        l[l1], l[l2], l[l3] = t.v_d, t.v_rcm, np.eye(3).ravel()
        return W, l

    def decay(self, delta: Array, t_s: float, dt_s: float) -> Array:
        """Error delta after one period: the closed form of eq. (27) with the activation (28)."""
        return _decay(delta, self._progress(t_s, dt_s), self._bound)

    def _progress(self, t_s: float, dt_s: float) -> float:
        """The decay exponent: beta * integral of min(exp(t), exp(cap)) over one period."""
        return self._c.beta * _capped_exponential_integral(t_s, t_s + dt_s, self._c.exponent_cap)

    def recover_qdot(self, t: Terms, rhs: Array) -> Array:
        """Joint velocity q' (7,) of W z = rhs through the block structure of W.

        Raises:
            numpy.linalg.LinAlgError: If W is singular and the rows are `normal`.
        """
        c = self._c
        K, b = _kkt(np.concatenate((t.J, t.J_rcm)), t.A, t.D, rhs, c.h0, c.h1, c.h2, c.h3)
        return self._solve(K, b)[:7]

    def _step_exact(
        self, p: VelocityProblem, J: Array, v_d: Array, v_rcm: Array, memory: VprnnMemory
    ) -> tuple[Array, VprnnMemory]:
        c = self._c
        delta = _NO_ROWS[:, 0] if memory.delta is None else memory.delta
        tau = self._progress(p.t_s, p.dt_s)
        K, b, delta = _exact_system(
            J, p.kin.z_W, v_d, v_rcm, delta, tau, self._bound, c.h0, c.h1, c.h2, c.h3, c.h4
        )
        return self._solve(K, b)[:7], VprnnMemory(delta=delta)

    def _step_euler(self, t: Terms, p: VelocityProblem, memory: VprnnMemory) -> tuple[Array, VprnnMemory]:
        """Explicit Euler of eq. (29), z' = W^-1 (-W' z + l' - beta exp(t) phi(W z - l)); W', l' backward."""
        W, l = self.system(t)  # noqa: E741
        z = np.zeros(len(l)) if memory.z is None else memory.z
        W_old = W if memory.W is None else memory.W
        l_old = l if memory.l is None else memory.l
        gain = self._c.beta * math.exp(min(p.t_s, self._c.exponent_cap))
        delta = W @ z - l
        phi = np.clip(delta, -self._bound, self._bound)
        z_dot = self._solve(W, (l - l_old - (W - W_old) @ z) / p.dt_s - gain * phi)
        z = z + p.dt_s * z_dot
        return z[:7].copy(), VprnnMemory(z=z, W=W, l=l)


@compiled
def _decay(delta: Array, tau: float, bound: float) -> Array:
    """The linear range decays as exp(-tau); a saturated entry falls at its bound's rate until then."""
    out = np.empty(delta.size)
    for i in range(delta.size):
        size = abs(delta[i])
        until = max(size - bound, 0.0) / bound if bound < np.inf else 0.0
        left = min(size, bound) * np.exp(-(tau - until)) if until < tau else size - bound * tau
        out[i] = left if delta[i] > 0.0 else -left
    return out


@compiled
def _kkt(
    J: Array, A: Array, D: Array, rhs: Array, h0: float, h1: float, h2: float, h3: float
) -> tuple[Array, Array]:
    """Rows of W z = rhs that hold q', lambda1 and lambda2, with psi solved from the last rows.

    J stacks J_T on J_rcm, (3 + r, 7).
    """
    m = J.shape[0]
    columns = rhs[16 + m :].copy().reshape(3, 3).T
    psi = np.linalg.solve(A, columns).T.copy().ravel()
    K = np.zeros((7 + m, 7 + m))
    for i in range(7):
        for j in range(i, 7):
            for k in range(m):
                K[i, j] += (h2 if k < 3 else h3) * J[k, i] * J[k, j]
            K[j, i] = K[i, j]
        K[i, i] += h1
        for k in range(m):
            K[i, 7 + k] = -J[k, i]
            K[7 + k, i] = J[k, i]
    b = np.empty(7 + m)
    b[:7] = rhs[:7] + h0 * (D @ psi)
    b[7:] = rhs[16 : 16 + m]
    return K, b


@compiled
def _exact_system(
    J: Array,
    z: Array,
    v_d: Array,
    v_rcm: Array,
    delta: Array,
    tau: float,
    bound: float,
    h0: float,
    h1: float,
    h2: float,
    h3: float,
    h4: float,
) -> tuple[Array, Array, Array]:
    """The KKT system of one exact step, and delta after it; an empty `delta` stands for z = 0."""
    J_T = J[:3]
    A = J_T @ J_T.T
    m = J.shape[0]
    right = np.empty(25 + m)
    right[:7] = h2 * (v_d @ J_T) + h3 * (v_rcm @ J[3:])
    right[7:16] = h4 * A.ravel()
    right[16:19] = v_d
    right[19 : 16 + m] = v_rcm
    right[16 + m :] = np.eye(3).ravel()
    delta = _decay(-right if delta.size == 0 else delta, tau, bound)
    K, b = _kkt(J, A, diamond(J_T, jacobian_gradient(J_T, z)), right + delta, h0, h1, h2, h3)
    return K, b, delta


def _rank_revealing_solve(A: Array, b: Array) -> Array:
    return np.asarray(np.linalg.lstsq(A, b, rcond=1e-10)[0])


def _capped_exponential_integral(start: float, end: float, cap: float) -> float:
    """Integral of min(exp(t), exp(cap)) from `start` to `end`."""
    grows_to = min(end, cap)
    grown = math.exp(grows_to) - math.exp(start) if start < grows_to else 0.0
    return grown + math.exp(cap) * max(end - max(start, cap), 0.0)
