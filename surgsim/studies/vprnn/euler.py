"""Where explicit Euler of eq. (29) breaks, and that the closed form does not."""

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from surgsim.control.failure import ControlFailure
from surgsim.studies.study import Row
from surgsim.studies.vprnn.cases import METHODS, NOMINAL, errors, outcome, run_case
from surgsim.studies.vprnn.equations import Network
from surgsim.studies.vprnn.network import Instant

Array = NDArray[np.float64]

CELLS = tuple((beta, period) for beta in (100.0, 1000.0) for period in (1e-3, 5e-4, 1e-4))
_BEFORE_S, _AFTER_S = 0.4, 0.4
_BROKEN_M_PER_S = 1e-3


def limit_s(period_s: float, beta: float) -> float:
    """Time at which T beta exp(t) = 2: from then on a step of eq. (29) enlarges delta."""
    return math.log(2.0 / (period_s * beta))


def euler_deltas(at: Instant, beta: float, period_s: float) -> tuple[Array, Array]:
    """Time [s] and |W z - l| of the Euler form on the still problem, from z = 0 a little before the limit.

    Ends where the network diverges.
    """
    config = at.vprnn.model_copy(update={"integration": "euler", "beta": beta})
    net = Network(config, at.arm, at.problem)
    W, l, resolver = net.W, net.l, net.resolver  # noqa: E741 - the paper's name
    first = max(0, round((limit_s(period_s, beta) - _BEFORE_S) / period_s))
    problem = replace(at.problem, t_s=first * period_s, dt_s=period_s)
    sizes = [float(np.linalg.norm(l))]
    memory: Array | None = None
    for k in range(first, first + round((_BEFORE_S + _AFTER_S) / period_s)):
        try:
            _, memory = resolver.step(replace(problem, t_s=k * period_s), memory)
        except ControlFailure:
            break
        sizes.append(float(np.linalg.norm(W @ memory[: len(l)] - l)))
    return period_s * np.arange(first, first + len(sizes), dtype=float), np.array(sizes)


def exact_deltas(at: Instant, beta: float, period_s: float, times: Array) -> Array:
    """|delta| of the closed form at the same times."""
    net = Network(at.vprnn.model_copy(update={"beta": beta}), at.arm, at.problem)
    delta, sizes = -net.l, []
    for t in times:
        sizes.append(float(np.linalg.norm(delta)))
        delta = net.decay(delta, float(t), period_s)
    return np.array(sizes)


def euler_row(at: Instant, beta: float, period_s: float) -> Row:
    """Predicted limit, the last step at which |delta| did not grow, and when it passes its start."""
    t, size = euler_deltas(at, beta, period_s)
    broken = np.flatnonzero(size[1:] > size[0])
    last = int(broken[0]) + 1 if len(broken) else len(size) - 1
    shrinking = np.flatnonzero(np.diff(size[: last + 1]) <= 0.0)
    exact = exact_deltas(at, beta, period_s, t)
    return {
        "beta_per_s": beta,
        "period_ms": 1e3 * period_s,
        "limit_ln_2_over_T_beta_s": limit_s(period_s, beta),
        "grows_from_s": float(t[shrinking[-1] + 1]),
        "above_its_start_s": float(t[last]) if len(broken) else None,
        "smallest_delta": float(size.min()),
        "exact_form_delta_then": float(exact[last]),
    }


def euler_table(at: Instant, cells: Iterable[tuple[float, float]]) -> list[Row]:
    """Every (beta, T)."""
    return [euler_row(at, beta, period) for beta, period in cells]


def arm_row(plant: str, integration: str) -> Row:
    """The sinusoid at 1 kHz with the network integrated in this way."""
    keys = (f"plant.type={plant}", f"controller.resolver.integration={integration}")
    trace = run_case(METHODS["vprnn"], NOMINAL, keys)
    unmet = np.flatnonzero(trace["resolver_residual_m_per_s"] > _BROKEN_M_PER_S)
    after = unmet[trace["t_s"][unmet] > 0.1]
    return {
        "plant": plant,
        "integration": integration,
        "outcome": outcome(trace),
        "end_s": trace.meta.ending.t_s,
        "rows_unmet_from_s": float(trace["t_s"][after[0]]) if len(after) else None,
        **errors(trace),
    }


def arm_table(plants: Iterable[str]) -> list[Row]:
    """Each plant with both forms."""
    return [arm_row(plant, form) for plant in plants for form in ("euler", "exact")]
