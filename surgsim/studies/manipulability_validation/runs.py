"""Runs the cells, and finds what self-motion could reach along each path."""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from surgsim.metrics.optimality import attainable_manipulability
from surgsim.simulate.loop import Simulation
from surgsim.studies.manipulability_validation.setup import (
    DURATION_S,
    PERIOD_S,
    SMOOTH_RAMP_S,
    STEPS,
    Cell,
    DhVariant,
    Method,
    Timing,
    prepared,
)
from surgsim.studies.study import Progress
from surgsim.tasks.profile import Profile
from surgsim.trace.trace import Trace

Array = NDArray[np.float64]
SAMPLES = 41
PRINTED_NETWORKS: tuple[dict[str, float | str], ...] = (
    {"form": "printed", "epsilon_s": 0.01, "c1": 1.0},
    {"form": "printed", "epsilon_s": 0.001, "c1": 1.0},
    {"form": "printed", "epsilon_s": 6e-4, "c1": 1.0},
    {"form": "printed", "epsilon_s": 6e-4, "c1": 0.0},
    {"form": "corrected", "epsilon_s": 6e-4, "c1": 0.0},
    {"form": "corrected", "epsilon_s": 6e-4, "c1": 1.0},
)
"""Signs and constants of eq. (7) that are tried; the last is the study's."""


@dataclass(frozen=True, kw_only=True)
class Attainable:
    """Largest mu that self-motion reaches, by progress along the path.

    Attributes:
        progress: Progress s along the path at each row of a smooth run (rows,).
        mu: mu* there (rows,).
    """

    progress: Array
    mu: Array

    def along(self, timing: str) -> Array:
        """mu* at every row of a run with this timing (rows,)."""
        if timing == "smooth":
            return self.mu
        return np.interp(np.linspace(0.0, 1.0, STEPS + 1), self.progress, self.mu)


def run_cell(cell: Cell, **network: float | str) -> Trace:
    """The trace of a cell: row k is the state after k steps."""
    return Simulation(prepared(cell, **network)).run()


def run_cells(cells: Iterable[Cell], progress: Progress) -> dict[Cell, Trace]:
    """Traces of all cells."""
    traces = {}
    for cell in cells:
        variant = "" if cell.dh_variant == "standard" else ", d2 = 0.2"
        progress(f"{cell.path}, home {cell.home}: {cell.method}, {cell.timing} timing{variant}")
        traces[cell] = run_cell(cell)
    return traces


def cells_of(
    methods: Iterable[Method],
    sample: Iterable[tuple[str, int]],
    timing: Timing = "paper",
    dh_variant: DhVariant = "standard",
) -> list[Cell]:
    """A cell for each (path, home) of the sample and each method."""
    return [
        Cell(path=path, home=home, method=method, timing=timing, dh_variant=dh_variant)
        for (path, home), method in product(sample, methods)
    ]


def attainable(smooth: Iterable[Trace], ours: Trace) -> Attainable:
    """mu* along a path: at each sample the largest found from any of the smooth runs, and by our run itself.

    The runs of a cell have the same tip positions at the same rows, so that what one of them finds another
    could have reached. Between samples mu* is interpolated linearly.
    """
    best: Array = np.zeros(SAMPLES)
    for trace in smooth:
        rows, found = attainable_manipulability(trace, SAMPLES)
        best = np.maximum(best, found)
    every = np.arange(STEPS + 1)
    curve = np.maximum(np.interp(every, rows, best), ours["manipulability"])
    profile = Profile(hold_start_s=0.0, duration_s=DURATION_S, ramp_s=SMOOTH_RAMP_S, hold_end_s=0.0)
    s = np.array([profile.progress(k * PERIOD_S)[0] for k in every])
    return Attainable(progress=s, mu=curve)


def mean_mu(trace: Trace, column: str = "manipulability") -> float:
    """Average over steps 1 to N, or to the step at which the run ended."""
    return float(np.mean(trace[column][1:]))


def matched_errors(trace: Trace) -> Array:
    """|p(k) - r(k)| for k = 1..N [m]: position and desired position of the same step."""
    return np.asarray(np.linalg.norm(trace.block("tip")[1:] - trace.block("tip_ref")[1:], axis=1))


def lagged_errors(trace: Trace) -> Array:
    """|p(k-1) - r(k)| for k = 1..N [m]: the new desired position against the position before the step."""
    return np.asarray(np.linalg.norm(trace.block("tip")[:-1] - trace.block("tip_ref")[1:], axis=1))


def position_margin_rad(trace: Trace) -> float:
    """Smallest distance of a joint from its position limit [rad]."""
    q = trace.block("q")
    low, high = (np.array(trace.meta.limits[name]) for name in ("q_min", "q_max"))
    return float(np.min(np.minimum(q - low, high - q)))


def velocity_ratio(trace: Trace) -> float:
    """Largest joint velocity over its limit."""
    return float(np.max(np.abs(trace.block("v")) / np.array(trace.meta.limits["velocity"])))


def acceleration_ratio(trace: Trace) -> float:
    """Largest change of joint velocity in one step, from rest on, over what the acceleration limit allows."""
    steps = np.diff(trace.block("v"), axis=0) / trace.meta.control_period_s
    return float(np.max(np.abs(steps) / np.array(trace.meta.limits["acceleration"])))
