"""Figures that the paper does not have: convergence of the networks and of the arm, explicit Euler."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from surgsim.studies.figure import BLUE, PURPLE, VERMILLION, Axes, figure
from surgsim.studies.vprnn.cases import METHODS, TABLE_I_RATIO
from surgsim.studies.vprnn.euler import CELLS, euler_deltas, limit_s
from surgsim.studies.vprnn.network import (
    PERIOD_S,
    SEEDS,
    Instant,
    optimum,
    rnn_velocities,
    vprnn_velocities,
)
from surgsim.studies.vprnn.starts import STARTED, WATCHED_S, Starts

Array = NDArray[np.float64]
_FEEDBACK_PER_S = 5.0
_EVERY = 5
_SHOWN = 8


def draw_networks(at: Instant, out: Path) -> None:
    """Distance of q' from its steady state, from random network states."""
    title = "Not in the paper: the networks alone, from random states, on a problem that stands still"
    with figure(out, title, 1, 2, size=(11.0, 4.6), sharey=True) as axes:
        _distances(axes[0, 0], at, "vprnn", np.array([vprnn_velocities(at, seed, 30) for seed in SEEDS]))
        _distances(axes[0, 1], at, "rnn", np.array([rnn_velocities(at, seed, 1500) for seed in SEEDS]))
        t = np.linspace(0.0, 0.03, 200)
        closed = np.exp(-at.vprnn.beta * np.expm1(t))
        _formula(axes[0, 0], 1e3 * t, closed, r"Theorem 1: $\exp(-\beta(e^t-1))$")
        slowest, t = at.rnn.c2 / at.rnn.epsilon_s, np.linspace(0.0, 1.5, 50)
        _formula(axes[0, 1], 1e3 * t, np.exp(-slowest * t), f"self-motion: c2/epsilon = {slowest:g} 1/s")
        for ax in axes.flat:
            ax.legend(frameon=False, fontsize=10, loc="upper right")
            ax.set(xlabel="time (ms)", ylim=(1e-10, 1e2))
        axes[0, 0].set_ylabel("distance of q' from the optimum\n(start: 1)")


def _distances(ax: Axes, at: Instant, name: str, velocities: Array) -> None:
    end = optimum(at.problem, TABLE_I_RATIO[name])
    for path in velocities:
        distance = np.linalg.norm(path - end, axis=1)
        t = PERIOD_S * np.arange(len(path))
        width = 4.0 if name == "vprnn" else 1.0
        ax.semilogy(1e3 * t, distance / distance[0], color=METHODS[name].colour, linewidth=width, alpha=0.7)
    ax.set_title(f"{METHODS[name].label}, Table I, {len(velocities)} starts")


def _formula(ax: Axes, x: Array, y: Array, label: str) -> None:
    ax.semilogy(x, y, "--", color="black", linewidth=1.4, label=label)


def draw_euler(at: Instant, out: Path) -> None:
    """|delta| of explicit Euler around the limit, for each T and beta."""
    title = "Not in the paper: explicit Euler of eq. (29) breaks at t = ln(2/(Tβ)) (dashed)"
    with figure(out, title, 1, 2, size=(11.0, 4.4), sharey=True) as axes:
        for (beta, period), colour in zip(CELLS, 2 * (VERMILLION, BLUE, PURPLE), strict=True):
            ax = axes[0, 0] if beta == CELLS[0][0] else axes[0, 1]
            t, size = euler_deltas(at, beta, period)
            ax.semilogy(t, size / size[0], color=colour, linewidth=1.4, label=f"T = {1e3 * period:g} ms")
            ax.axvline(limit_s(period, beta), color=colour, linestyle="--", linewidth=1.3)
            ax.set(title=f"β = {beta:g} 1/s", xlabel="time (s)", ylim=(1e-22, 1e10))
        for ax in axes.flat:
            ax.legend(framealpha=1.0, edgecolor="white", fontsize=10, loc="lower center", ncols=3)
        axes[0, 0].set_ylabel("‖δ‖ / ‖δ(0)‖")


def draw_starts(runs: Starts, out: Path) -> None:
    """Tip and RCM error of the first near random starts under torques."""
    title = f"Not in the paper: {_SHOWN} random initial configurations under torques, the path's start held"
    with figure(out, title, 2, len(STARTED), size=(11.5, 6.0), sharex=True, sharey="row") as axes:
        for column, name in zip(axes.T, STARTED, strict=True):
            near = [trace for key, trace in runs.items() if key[:3] == (name, "dynamic", "near")][:_SHOWN]
            for ax, error in zip(column, ("tip_error_m", "rcm_error_m"), strict=True):
                for trace in near:
                    t, e = trace["t_s"][::_EVERY], 1e3 * trace[error][::_EVERY]
                    ax.semilogy(t, e, color=METHODS[name].colour, linewidth=0.8, alpha=0.6)
            column[0].set_title(METHODS[name].label)
            column[1].set_xlabel("time (s)")
        t = np.linspace(0.0, WATCHED_S, 50)
        for row, size, label in ((axes[0], 20.0, "tip error (mm)"), (axes[1], 10.0, "RCM error (mm)")):
            row[0].set_ylabel(label)
            for ax in row:
                decay = size * np.exp(-_FEEDBACK_PER_S * t)
                _formula(ax, t, decay, "exp(-k t), k1 = k2 = 5 1/s")
                ax.set_ylim(1e-4, 60.0)
        axes[0, 0].legend(frameon=False, fontsize=9.5, loc="upper right")
