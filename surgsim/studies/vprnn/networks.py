"""The networks alone, on the problem of one instant of the path that stands still: cases and figures."""

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.integrate import solve_ivp

from surgsim.array import Array
from surgsim.control.failure import ControlFailure
from surgsim.control.manipulability import log_manipulability_gradient
from surgsim.control.null_space import least_velocity
from surgsim.control.problem import VelocityProblem, stacked_rows
from surgsim.control.resolvers.rnn import RnnConfig
from surgsim.control.resolvers.vprnn import VprnnConfig
from surgsim.control.resolvers.vprnn_system import Network
from surgsim.display import count
from surgsim.models.arm import ArmModel
from surgsim.scenario.load import load_controller
from surgsim.simulate.setup import prepare
from surgsim.studies.figure import BLUE, PURPLE, VERMILLION, Axes, formula, label
from surgsim.studies.measures import within_from_s
from surgsim.studies.still import still_problem
from surgsim.studies.study import Case, Judged, Measured, Results, holds
from surgsim.studies.tables import Row, Tables, number, numbers, pick, span
from surgsim.studies.vprnn.cases import METHODS, PAPER, sinusoid

PERIOD_S = 1e-3
SEEDS = tuple(range(10))
Z_SPREAD = 10.0
BOUNDS: tuple[float | None, ...] = (None, 1.0)
EULER = tuple((beta, period) for beta in (100.0, 1000.0) for period in (1e-3, 5e-4, 1e-4))
LEFT = 0.01
_AT_S, EULER_S = 3.0, 0.05


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

    def network(self, **changes: object) -> Network:
        """The VPRNN with other constants."""
        return Network(self.vprnn.model_copy(update=changes), self.arm, self.problem)


@lru_cache(maxsize=1)
def instant() -> Instant:
    """The arm at its start configuration, with the command of 3 s as the offset to follow."""
    setup = prepare(sinusoid("vprnn"))
    problem = still_problem(setup, _AT_S, PERIOD_S)
    vprnn, rnn = (load_controller(name).resolver for name in ("vprnn", "rnn"))
    assert isinstance(vprnn, VprnnConfig)
    assert isinstance(rnn, RnnConfig)
    return Instant(problem=problem, arm=setup.arm, vprnn=vprnn, rnn=rnn)


def optimum(problem: VelocityProblem, rate: float) -> Array:
    """pinv(J) v + rate N grad(ln mu) (n,) [rad/s], with J = [J_T; J_rcm]."""
    J, v = stacked_rows(problem, 5.0, 5.0)
    climb = rate * log_manipulability_gradient(problem.kin.Jv_WT, problem.kin.z_W)
    return least_velocity(J, v, climb)


def cross_form_rank(at: Instant) -> tuple[int, int]:
    """Rank and size of W with the paper's three cross-product rows."""
    W = at.network(rcm_rows="cross").W
    values = np.linalg.svd(W, compute_uv=False)
    return int(np.sum(values > 1e-10 * values[0])), len(W)


def random_delta(at: Instant, seed: int) -> Array:
    """delta(0) = W z(0) - l (30,) of a random z(0), each entry normal with deviation `Z_SPREAD`."""
    net = at.network()
    z = Z_SPREAD * np.random.default_rng(seed).standard_normal(len(net.l))
    return np.asarray(net.W @ z - net.l)


def vprnn_velocities(at: Instant, seed: int, steps: int) -> Array:
    """Joint velocity q' (steps + 1, n) [rad/s] of the network from a random z(0), a row a control period."""
    net, delta, found = at.network(), random_delta(at, seed), []
    for k in range(steps + 1):
        found.append(net.velocity(delta))
        delta = net.decay(delta, k * PERIOD_S, PERIOD_S)
    return np.array(found)


def rnn_velocities(at: Instant, seed: int, steps: int) -> Array:
    """Omega (steps + 1, n) [rad/s] of Jin's network from random states, a row a control period."""
    net, rng = at.rnn.build(at.arm), np.random.default_rng(seed)
    n, rows = at.problem.q.size, 3 if at.problem.rcm is None else 5
    A = at.problem.kin.Jv_WT @ at.problem.kin.Jv_WT.T
    omega = 0.5 * rng.standard_normal(n)
    phi = np.asarray(np.linalg.inv(A)).ravel() + rng.standard_normal(9)
    lambda_ = rng.standard_normal(rows)
    memory = np.concatenate([omega, phi, rng.standard_normal(9), lambda_])
    found = [memory[:n]]
    for _ in range(steps):
        _, memory = net.step(at.problem, memory)
        found.append(memory[:n])
    return np.array(found)


@dataclass(frozen=True)
class Settling(Case):
    """Settling of q' from random network states, and how far the steady state is from its formula."""

    seed: int

    def measured(self) -> Measured:
        """Time from which the distance to the optimum stays below 1 % of the start's, and the last one."""
        at = instant()
        paths = {"vprnn": vprnn_velocities(at, self.seed, 50), "rnn": rnn_velocities(at, self.seed, 6000)}
        settled, ends, curves = {}, {}, {}
        for name, path in paths.items():
            end = optimum(at.problem, PAPER["climbing_rate"][name])
            distance = np.linalg.norm(path - end, axis=1)
            t: Array = PERIOD_S * np.arange(len(path), dtype=float)
            settled[f"{name}_1_percent_s"] = within_from_s(t, distance, LEFT * distance[0])
            ends[f"{name}_end_deviation"] = float(distance[-1] / np.linalg.norm(end))
            curves[name] = distance[: {"vprnn": 31, "rnn": 1501}[name]] / distance[0]
        return Measured(case=self, row={"seed": self.seed, **settled, **ends}, curves=curves)


@dataclass(frozen=True)
class Theorem(Case):
    """Eq. (27) from a random z(0), stepped by the network's `decay`, against three independent forms.

    The closed form delta(0) exp(-beta (exp(t) - 1)) (linear activation only), Runge-Kutta integration of
    eq. (27), and Theorem 1's V' = -beta exp(t) delta^T phi(delta) against the difference of V over a step.
    """

    bound: float | None
    seed: int

    def measured(self) -> Measured:
        """How far the forms are apart, and whether V falls."""
        at, step = instant(), 1e-5
        net, beta, limit = at.network(activation_bound=self.bound), at.vprnn.beta, self.bound or math.inf
        delta = [random_delta(at, self.seed)]
        while np.linalg.norm(delta[-1]) > 1e-6 * np.linalg.norm(delta[0]):
            delta.append(net.decay(delta[-1], (len(delta) - 1) * step, step))
        path, t = np.array(delta), step * np.arange(len(delta), dtype=float)
        size: Array = np.linalg.norm(path, axis=1)
        closed = path[0] * np.exp(-beta * np.expm1(t))[:, None]
        V = 0.5 * size**2
        slope = -beta * np.exp(t) * np.sum(path * np.clip(path, -limit, limit), axis=1)
        change = np.diff(V) - 0.5 * step * (slope[1:] + slope[:-1])
        row: Row = {
            "activation": f"saturated at {self.bound:g}" if self.bound else "linear",
            "seed": self.seed,
            "delta_start": float(size[0]),
            "time_to_1_percent_ms": 1e3 * float(t[np.argmax(size <= LEFT * size[0])]),
            "closed_form_deviation": None if self.bound else _relative(path, closed),
            "runge_kutta_deviation": _relative(path, _runge_kutta(path[0], t, beta, limit)),
            "V_rate_deviation": float(np.max(np.abs(change)) / np.max(np.abs(np.diff(V)))),
            "V_falls_at_every_step": "yes" if (np.diff(V) < 0.0).all() and (slope < 0.0).all() else "no",
        }
        return Measured(case=self, row=row)


def _relative(path: Array, other: Array) -> float:
    return float(np.max(np.abs(path - other)) / np.max(np.abs(path)))


def _runge_kutta(start: Array, t: Array, beta: float, limit: float) -> Array:
    def rate(time: float, delta: Array) -> Array:
        return np.asarray(-beta * math.exp(time) * np.clip(delta, -limit, limit))

    solved = solve_ivp(rate, (0.0, float(t[-1])), start, "DOP853", t, rtol=1e-9, atol=1e-9, max_step=1e-4)
    return np.asarray(solved.y.T)


@dataclass(frozen=True)
class Euler(Case):
    """Explicit Euler of eq. (29) on the still problem around the time at which it must break."""

    beta: float
    period_s: float

    @property
    def limit_s(self) -> float:
        """Time at which T beta exp(t) = 2: from then on a step of eq. (29) enlarges delta."""
        return math.log(2.0 / (self.period_s * self.beta))

    def measured(self) -> Measured:
        """Predicted limit, the last step at which |delta| did not grow, and when it passes its start."""
        t, size = self._deltas()
        broken = np.flatnonzero(size[1:] > size[0])
        last = int(broken[0]) + 1 if len(broken) else len(size) - 1
        shrinking = np.flatnonzero(np.diff(size[: last + 1]) <= 0.0)
        row = {
            "beta_per_s": self.beta,
            "period_ms": 1e3 * self.period_s,
            "limit_ln_2_over_T_beta_s": self.limit_s,
            "grows_from_s": float(t[shrinking[-1] + 1]),
            "above_its_start_s": float(t[last]) if len(broken) else None,
            "smallest_delta": float(size.min()),
            "exact_form_delta_then": self._exact_delta(t[:last]),
        }
        return Measured(case=self, row=row, curves={"t_s": t, "delta": size / size[0]})

    def _deltas(self) -> tuple[Array, Array]:
        """Time [s] and |W z - l| of the Euler form from z = 0, for 0.8 s or until it diverges."""
        at, period = instant(), self.period_s
        net = at.network(integration="euler", beta=self.beta)
        first, size = max(0, round((self.limit_s - 0.4) / period)), len(net.l)
        sizes, memory = [float(np.linalg.norm(net.l))], None
        for k in range(first, first + round(0.8 / period)):
            try:
                _, memory = net.resolver.step(replace(at.problem, t_s=k * period, dt_s=period), memory)
            except ControlFailure:
                break
            sizes.append(float(np.linalg.norm(net.W @ memory[:size] - net.l)))
        return period * np.arange(first, first + len(sizes), dtype=float), np.array(sizes)

    def _exact_delta(self, times: Array) -> float:
        """|delta| of the closed form after steps at these times, from z = 0."""
        net = instant().network(beta=self.beta)
        delta = -net.l
        for t in times:
            delta = net.decay(delta, float(t), self.period_s)
        return float(np.linalg.norm(delta))


def judge_euler(tables: Tables) -> Judged:
    """Whether Euler breaks where it must, and the arm with it."""
    rows, arm = tables["euler"], pick(tables["euler_arm"], integration="euler")
    off = [number(row, "grows_from_s") - number(row, "limit_ln_2_over_T_beta_s") for row in rows]
    wanted = {"euler": "diverged", "exact": "completed"}
    ended = all(row["outcome"] == wanted[str(row["integration"])] for row in tables["euler_arm"])
    ends = ", ".join(f"{row['plant']} plant at {number(row, 'end_s'):.2f} s" for row in arm)
    return holds(max(abs(x) for x in off) < EULER_S and ended), (
        f"delta grows from {span(off, 2)} s after that time for {count(len(off), 'pair')} of T and beta; "
        f"with Table I at 1 kHz the run ends as diverged: {ends}"
    )


def judge_steady_state(tables: Tables) -> Judged:
    """Whether both networks end at the formula."""
    rows = tables["network_rates"]
    vprnn, rnn = (max(numbers(rows, f"{name}_end_deviation")) for name in ("vprnn", "rnn"))
    return holds(max(vprnn, rnn) < 1e-9), (
        f"VPRNN to {vprnn:.0e}, RNN to {rnn:.0e}, from {count(len(rows), 'random state')}: "
        "h2, h3 and h4 vanish where the rows are met"
    )


def draw_networks(axes: Axes, results: Results, _: Tables) -> None:
    """Distance of q' from its steady state, from random network states."""
    for ax, name, width in zip(axes.flat, ("vprnn", "rnn"), (4.0, 1.0), strict=True):
        for found in results["network_rates"]:
            distance = found.curves[name]
            t_ms = 1e3 * PERIOD_S * np.arange(len(distance))
            ax.semilogy(t_ms, distance, color=METHODS[name].colour, linewidth=width, alpha=0.7)
    vprnn, rnn, t = instant().vprnn, instant().rnn, np.linspace(0.0, 0.03, 200)
    closed = np.exp(-vprnn.beta * np.expm1(t))
    formula(axes[0, 0], 1e3 * t, closed, r"Theorem 1: $\exp(-\beta(e^t-1))$")
    slowest, t = rnn.c2 / rnn.epsilon_s, np.linspace(0.0, 1.5, 50)
    formula(axes[0, 1], 1e3 * t, np.exp(-slowest * t), f"self-motion: c2/epsilon = {slowest:g} 1/s")
    for ax in axes.flat:
        ax.legend(frameon=False, fontsize=10, loc="upper right")
        ax.set_ylim(1e-10, 1e2)
    titles = [
        f"{METHODS[name].label}, Table I, {len(results['network_rates'])} starts" for name in ("vprnn", "rnn")
    ]
    label(axes, "time (ms)", ["distance of q' from the optimum\n(start: 1)"], titles)


def draw_euler(axes: Axes, results: Results, _: Tables) -> None:
    """|delta| of explicit Euler around the limit, for each T and beta."""
    for found, colour in zip(results["euler"], 2 * (VERMILLION, BLUE, PURPLE), strict=True):
        case, curves = found.case, found.curves
        ax = axes[0, 0] if case.beta == results["euler"][0].case.beta else axes[0, 1]
        ax.semilogy(
            curves["t_s"],
            curves["delta"],
            color=colour,
            linewidth=1.4,
            label=f"T = {1e3 * case.period_s:g} ms",
        )
        ax.axvline(case.limit_s, color=colour, linestyle="--", linewidth=1.3)
        ax.set(title=f"β = {case.beta:g} 1/s", ylim=(1e-22, 1e10))
    for ax in axes.flat:
        ax.legend(framealpha=1.0, edgecolor="white", fontsize=10, loc="lower center", ncols=3)
    label(axes, "time (s)", ["‖δ‖ / ‖δ(0)‖"])
