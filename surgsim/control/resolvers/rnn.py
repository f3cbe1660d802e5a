"""RNN: the dynamic neural network of Jin et al. for manipulability optimisation."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, NonNegativeFloat, PositiveFloat

from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.control.manipulability import diamond, jacobian_gradient
from surgsim.control.problem import (
    ControlFailure,
    Resolution,
    VelocityProblem,
    bounded_resolution,
    stacked_rows,
)
from surgsim.errors import Outcome
from surgsim.models.arm import ArmModel

Array = NDArray[np.float64]
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

    def build(self, arm: ArmModel) -> "Rnn":
        """The resolver."""
        return Rnn(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class RnnMemory:
    """Neural states: omega (7,), phi (9,), lam (r,), sigma (9,) of eq. (6)-(9)."""

    omega: Array
    phi: Array
    lam: Array
    sigma: Array


class Rnn:
    """The network of eq. (6)-(9) of the manipulability paper, with D = J <> H and B = I x J J^T.

        eps omega'  = -omega + P_Omega[c3 D phi - c0 J_a^T (J_a omega - v) + (1 - c2) omega - J_a^T lam]
        eps phi'    = +c3 D^T omega + B sigma - c1 B (B phi - vec I)
        eps lam'    = J_a omega - v
        eps sigma'  = vec I - B phi

    Eq. (7) is printed with the signs of the c3 and c1 terms flipped, which is unstable. J_a is J_T, or
    [J_T; J_rcm]. The command is the mean of omega over the period, so that without feedback the integrated
    tip error is exactly eps (lam - lam(0)). In the steady state omega = pinv(J_a) v + (c3/c2) N grad(ln mu).

    The network starts at omega = 0, phi = vec((J J^T)^-1), lam = 0, sigma = 0.
    """

    def __init__(self, config: RnnConfig) -> None:
        self._c = config

    def start(self, problem: VelocityProblem) -> RnnMemory:
        """Neural states at rest, phi at its solution."""
        J, _ = self._rows(problem)
        A = problem.kin.Jv_WT @ problem.kin.Jv_WT.T
        return RnnMemory(
            omega=np.zeros(7),
            phi=np.asarray(np.linalg.inv(A)).ravel(),
            lam=np.zeros(len(J)),
            sigma=np.zeros(9),
        )

    def step(self, problem: VelocityProblem, memory: RnnMemory) -> tuple[Resolution, RnnMemory]:
        """Integrate the network over one period."""
        c, kin = self._c, problem.kin
        J_a, v = self._rows(problem)
        substeps = math.ceil(problem.dt_s / (c.step_over_epsilon * c.epsilon_s) - 1e-9)
        D = diamond(kin.Jv_WT, jacobian_gradient(kin.Jv_WT, kin.z_W))
        sign = 1.0 if c.form == "corrected" else -1.0
        mean, omega, phi, lam, sigma = _flow(
            J_a,
            v,
            D,
            kin.Jv_WT @ kin.Jv_WT.T,
            problem.lower,
            problem.upper,
            memory.omega,
            memory.phi,
            memory.lam,
            memory.sigma,
            c.c0,
            c.c1,
            c.c2,
            c.c3,
            sign,
            problem.dt_s / substeps / c.epsilon_s,
            substeps,
        )
        if not (np.abs(phi).max() < _DIVERGED and np.abs(sigma).max() < _DIVERGED):
            raise ControlFailure(Outcome.DIVERGED, f"RNN ({c.form} form): a neural state exceeds 1e12")
        out = RnnMemory(omega=omega, phi=phi, lam=lam, sigma=sigma)
        return bounded_resolution(problem, mean, J_a, v), out

    def _rows(self, problem: VelocityProblem) -> tuple[Array, Array]:
        return stacked_rows(problem, self._c.k_tip, self._c.k_rcm, rcm=self._c.rcm)


@compiled
def _flow(
    J: Array,
    v: Array,
    D: Array,
    A: Array,
    lower: Array,
    upper: Array,
    omega: Array,
    phi: Array,
    lam: Array,
    sigma: Array,
    c0: float,
    c1: float,
    c2: float,
    c3: float,
    sign: float,
    h: float,
    substeps: int,
) -> tuple[Array, Array, Array, Array, Array]:
    """`substeps` explicit Euler steps of length `h` time constants; also the mean of omega over them."""
    vec_I = np.eye(3).ravel()
    mean = np.zeros(7)
    DT = np.ascontiguousarray(D.T)
    JT = np.ascontiguousarray(J.T)
    for _ in range(substeps):
        mean += omega
        gap = J @ omega - v
        B_phi = (phi.reshape(3, 3) @ A).ravel()
        B_gap = ((B_phi - vec_I).reshape(3, 3) @ A).ravel()
        B_sigma = (sigma.reshape(3, 3) @ A).ravel()
        inside = c3 * (D @ phi) - JT @ (c0 * gap + lam) + (1.0 - c2) * omega
        inside = np.minimum(np.maximum(inside, lower), upper)
        d_phi = sign * (c3 * (DT @ omega) - c1 * B_gap) + B_sigma
        omega = omega + h * (inside - omega)
        phi = phi + h * d_phi
        lam = lam + h * gap
        sigma = sigma + h * (vec_I - B_phi)
    return mean / substeps, omega, phi, lam, sigma
