"""Convergence of the networks alone, on the problem of one instant of the path that stands still."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from surgsim.control.manipulability import diamond, jacobian_gradient, log_manipulability_gradient
from surgsim.control.null_space import least_velocity
from surgsim.control.problem import VelocityProblem, stacked_rows, velocity_bounds
from surgsim.control.rcm import rcm_kinematics
from surgsim.control.resolvers.rnn import RnnConfig
from surgsim.control.resolvers.vprnn import VprnnConfig
from surgsim.models.arm import ArmModel
from surgsim.scenario.load import load_controller
from surgsim.simulate.setup import Setup, prepare
from surgsim.studies.study import Row
from surgsim.studies.vprnn.cases import METHODS, TABLE_I_RATIO, scenario
from surgsim.studies.vprnn.equations import Network

Array = NDArray[np.float64]

PERIOD_S = 1e-3
SEEDS = tuple(range(10))
Z_SPREAD = 10.0
BOUNDS: tuple[float | None, ...] = (None, 1.0)
LEFT = 0.01
_AT_S = 3.0
_RNN_STEPS = 6000


@dataclass(frozen=True, kw_only=True)
class Instant:
    """The velocity problem of one instant, held still.

    Attributes:
        problem: The problem.
        arm: The nominal arm.
        vprnn: Table I's VPRNN.
        rnn: Table I's RNN.
    """

    problem: VelocityProblem
    arm: ArmModel
    vprnn: VprnnConfig
    rnn: RnnConfig


def instant(t_s: float = _AT_S) -> Instant:
    """The arm at its start configuration, with the command of time `t_s` as the offset to follow."""
    setup = prepare(scenario(METHODS["vprnn"]))
    return Instant(
        problem=_problem(setup, t_s),
        arm=setup.arm,
        vprnn=load_controller("vprnn").resolver,
        rnn=load_controller("rnn").resolver,
    )


def _problem(setup: Setup, t_s: float) -> VelocityProblem:
    state = setup.plant.reset(setup.q_start)
    gain = setup.scenario.controller.position_gain_per_s
    lower, upper = velocity_bounds(state.q, setup.arm.limits, gain)
    command, here = setup.task.command(t_s), setup.arm.kinematics(state.q)
    return VelocityProblem(
        t_s=0.0,
        dt_s=PERIOD_S,
        q=state.q,
        v=state.v,
        kin=here,
        command=replace(command, p_WTd=here.p_WT),
        rcm=rcm_kinematics(here, state.p_WC, state.v_WC),
        p_WC=state.p_WC,
        v_WC=state.v_WC,
        lower=lower,
        upper=upper,
        limits=setup.arm.limits,
        position_gain_per_s=gain,
    )


def optimum(problem: VelocityProblem, rate: float) -> Array:
    """pinv(J) v + rate N grad(ln mu) (7,) [rad/s], with J = [J_T; J_rcm]."""
    J, v = stacked_rows(problem, 5.0, 5.0)
    climb = rate * log_manipulability_gradient(problem.kin.Jv_WT, problem.kin.z_W)
    return least_velocity(J, v, climb)


def random_delta(at: Instant, seed: int) -> Array:
    """delta(0) = W z(0) - l (30,) of a random z(0), each entry normal with deviation `Z_SPREAD`."""
    net = Network(at.vprnn, at.arm, at.problem)
    z = Z_SPREAD * np.random.default_rng(seed).standard_normal(len(net.l))
    return np.asarray(net.W @ z - net.l)


def theorem_row(at: Instant, seed: int, bound: float | None) -> Row:
    """Eq. (27) from a random z(0), stepped by the network's `decay`, against three independent forms.

    The closed form delta(0) exp(-beta (exp(t) - 1)) (linear activation only), Runge-Kutta integration of
    eq. (27), and Theorem 1's V' = -beta exp(t) delta^T phi(delta) against the difference of V over a step.
    """
    net = Network(at.vprnn.model_copy(update={"activation_bound": bound}), at.arm, at.problem)
    beta, step, limit = at.vprnn.beta, 1e-5, math.inf if bound is None else bound
    delta = [random_delta(at, seed)]
    while np.linalg.norm(delta[-1]) > 1e-6 * np.linalg.norm(delta[0]):
        delta.append(net.decay(delta[-1], (len(delta) - 1) * step, step))
    path, t = np.array(delta), step * np.arange(len(delta), dtype=float)
    size: Array = np.linalg.norm(path, axis=1)
    closed = path[0] * np.exp(-beta * np.expm1(t))[:, None]
    V = 0.5 * size**2
    slope = -beta * np.exp(t) * np.sum(path * np.clip(path, -limit, limit), axis=1)
    change = np.diff(V) - 0.5 * step * (slope[1:] + slope[:-1])
    return {
        "activation": "linear" if bound is None else f"saturated at {bound:g}",
        "seed": seed,
        "delta_start": float(size[0]),
        "time_to_1_percent_ms": 1e3 * float(t[np.argmax(size <= LEFT * size[0])]),
        "closed_form_deviation": _relative(path, closed) if bound is None else None,
        "runge_kutta_deviation": _relative(path, _runge_kutta(path[0], t, beta, limit)),
        "V_rate_deviation": float(np.max(np.abs(change)) / np.max(np.abs(np.diff(V)))),
        "V_falls_at_every_step": "yes" if (np.diff(V) < 0.0).all() and (slope < 0.0).all() else "no",
    }


def _relative(path: Array, other: Array) -> float:
    return float(np.max(np.abs(path - other)) / np.max(np.abs(path)))


def _runge_kutta(start: Array, t: Array, beta: float, limit: float) -> Array:
    def rate(time: float, delta: Array) -> Array:
        return np.asarray(-beta * math.exp(time) * np.clip(delta, -limit, limit))

    solved = solve_ivp(rate, (0.0, float(t[-1])), start, "DOP853", t, rtol=1e-9, atol=1e-9, max_step=1e-4)
    return np.asarray(solved.y.T)


def theorem_table(at: Instant, seeds: Iterable[int]) -> list[Row]:
    """Every activation and seed."""
    chosen = tuple(seeds)
    return [theorem_row(at, seed, bound) for bound in BOUNDS for seed in chosen]


def vprnn_velocities(at: Instant, seed: int, steps: int) -> Array:
    """Joint velocity q' (steps + 1, 7) [rad/s] of the network from a random z(0), a row a control period."""
    net = Network(at.vprnn, at.arm, at.problem)
    delta, found = random_delta(at, seed), []
    for k in range(steps + 1):
        found.append(net.velocity(delta))
        delta = net.decay(delta, k * PERIOD_S, PERIOD_S)
    return np.array(found)


def rnn_velocities(at: Instant, seed: int, steps: int) -> Array:
    """Omega (steps + 1, 7) [rad/s] of Jin's network from random states, a row a control period."""
    net, rng = at.rnn.build(at.arm), np.random.default_rng(seed)
    n, rows = at.problem.q.size, 3 if at.problem.rcm is None else 5
    A = at.problem.kin.Jv_WT @ at.problem.kin.Jv_WT.T
    memory = np.concatenate(
        [
            0.5 * rng.standard_normal(n),
            np.asarray(np.linalg.inv(A)).ravel() + rng.standard_normal(9),
            np.zeros(9 + rows),
        ]
    )
    memory[n + 18 :] = rng.standard_normal(rows)
    memory[n + 9 : n + 18] = rng.standard_normal(9)
    found = [memory[:n]]
    for _ in range(steps):
        _, memory = net.step(at.problem, memory)
        found.append(memory[:n])
    return np.array(found)


def settling_time_s(velocities: Array, end: Array) -> float | None:
    """Time from which the distance to `end` stays below 1 % of the start's; None if never."""
    distance = np.linalg.norm(velocities - end, axis=1)
    late = np.flatnonzero(distance > LEFT * distance[0])
    return PERIOD_S * (int(late[-1]) + 1) if late[-1] + 1 < len(distance) else None


def rate_row(at: Instant, seed: int) -> Row:
    """Settling of q' from random network states, and how far the steady state is from its formula."""
    ends = {name: optimum(at.problem, rate) for name, rate in TABLE_I_RATIO.items()}
    vprnn, rnn = vprnn_velocities(at, seed, 50), rnn_velocities(at, seed, _RNN_STEPS)
    return {
        "seed": seed,
        "vprnn_1_percent_s": settling_time_s(vprnn, ends["vprnn"]),
        "rnn_1_percent_s": settling_time_s(rnn, ends["rnn"]),
        "vprnn_end_deviation": float(
            np.linalg.norm(vprnn[-1] - ends["vprnn"]) / np.linalg.norm(ends["vprnn"])
        ),
        "rnn_end_deviation": float(np.linalg.norm(rnn[-1] - ends["rnn"]) / np.linalg.norm(ends["rnn"])),
    }


def rnn_modes(at: Instant) -> Array:
    """Eigenvalues [1/s] of the RNN inside its bounds, slowest first: x' = (A x + b) / epsilon."""
    c, kin = at.rnn, at.problem.kin
    J, _ = stacked_rows(at.problem, c.k_tip, c.k_rcm)
    D = diamond(kin.Jv_WT, jacobian_gradient(kin.Jv_WT, kin.z_W))
    B, m = np.kron(np.eye(3), kin.Jv_WT @ kin.Jv_WT.T), len(J)
    A = np.zeros((25 + m, 25 + m))
    omega, phi, lam, sigma = slice(0, 7), slice(7, 16), slice(16, 16 + m), slice(16 + m, 25 + m)
    A[omega, omega], A[omega, phi] = -c.c2 * np.eye(7) - c.c0 * J.T @ J, c.c3 * D
    A[omega, lam], A[phi, omega] = -J.T, c.c3 * D.T
    A[phi, phi], A[phi, sigma] = -c.c1 * B @ B, B
    A[lam, omega], A[sigma, phi] = J, -B
    modes = np.linalg.eigvals(A) / c.epsilon_s
    return np.asarray(modes[np.argsort(-modes.real)])


def cross_form_rank(at: Instant) -> tuple[int, int]:
    """Rank and size of W with the paper's three cross-product rows."""
    W = Network(at.vprnn.model_copy(update={"rcm_rows": "cross"}), at.arm, at.problem).W
    values = np.linalg.svd(W, compute_uv=False)
    return int(np.sum(values > 1e-10 * values[0])), len(W)
