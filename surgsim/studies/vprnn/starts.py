"""Convergence of the arm from random initial configurations, the path's start held."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from surgsim.control.rcm import rcm_kinematics
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import Setup, prepare
from surgsim.studies.study import Progress, Row
from surgsim.studies.vprnn.cases import METHODS, NOMINAL, outcome, scenario
from surgsim.studies.vprnn.cells import number
from surgsim.trace.trace import Trace

Array = NDArray[np.float64]

CONVERGED_MM = 1.0
LEFT = 0.05
WATCHED_S = 3.0
SEEDS = tuple(range(20))
STARTED = ("nullspace", "rnn", "vprnn", "rcm_inverse_dynamics")
_HOLD = (f"task.hold_start_s={WATCHED_S + 1.0}",)


@dataclass(frozen=True, kw_only=True)
class Spread:
    """How far the starts are off.

    Attributes:
        deviation_rad: Standard deviation of the joints' displacement [rad].
        tip_mm: Smallest and largest distance of the tip from the path's start [mm].
        rcm_mm: Smallest and largest distance of the shaft from the trocar [mm].
    """

    deviation_rad: float
    tip_mm: tuple[float, float]
    rcm_mm: tuple[float, float]

    def draw(self, setup: Setup, seed: int) -> Array:
        """Joint positions (7,) [rad] inside the limits whose tip and shaft are displaced that far."""
        rng, limits = np.random.default_rng(seed), setup.arm.limits
        here = setup.arm.kinematics(setup.q_start).p_WT
        p_WC = setup.plant.reset(setup.q_start).p_WC
        while True:
            q = setup.q_start + self.deviation_rad * rng.standard_normal(7)
            kin = setup.arm.kinematics(q)
            tip = 1e3 * float(np.linalg.norm(kin.p_WT - here))
            rcm = 1e3 * float(np.linalg.norm(rcm_kinematics(kin, p_WC, np.zeros(3)).error))
            inside = bool((q > limits.q_min).all() and (q < limits.q_max).all())
            if inside and _between(tip, self.tip_mm) and _between(rcm, self.rcm_mm):
                return q


def _between(value: float, bounds: tuple[float, float]) -> bool:
    return bounds[0] <= value <= bounds[1]


SPREADS = {
    "near": Spread(deviation_rad=0.015, tip_mm=(5.0, 20.0), rcm_mm=(1.0, 10.0)),
    "far": Spread(deviation_rad=0.1, tip_mm=(50.0, 100.0), rcm_mm=(10.0, 50.0)),
}


def prepared(name: str, plant: str) -> Setup:
    """A controller on a plant, the path's start held for longer than is watched."""
    return prepare(scenario(METHODS[name], NOMINAL, (*_HOLD, f"plant.type={plant}")))


def run_start(setup: Setup, spread: Spread, seed: int) -> Trace:
    """The run from a random start."""
    simulation = Simulation(replace(setup, q_start=spread.draw(setup, seed)))
    while not simulation.ended and simulation.time_s < WATCHED_S:
        simulation.tick()
    return simulation.trace()


def within_from_s(t: Array, error: Array, threshold: float) -> float | None:
    """Time from which `error` stays at or below `threshold`; None if it does not."""
    late = np.flatnonzero(~(error <= threshold))
    if late.size == 0:
        return 0.0
    last = int(late[-1])
    return float(t[last + 1]) if last + 1 < len(t) else None


def _rate(t: Array, error: Array) -> float | None:
    """Decay rate [1/s] of the exponential that reaches 5 % when `error` last does; None if it does not."""
    time = within_from_s(t, error, LEFT * float(error[0]))
    return math.log(1.0 / LEFT) / time if time else None


def start_row(name: str, plant: str, spread: str, seed: int, trace: Trace) -> Row:
    """One run: displacement, convergence to 1 mm, equivalent rates."""
    t, tip, rcm = trace["t_s"], 1e3 * trace["tip_error_m"], 1e3 * trace["rcm_error_m"]
    done = outcome(trace) == "completed"
    return {
        "controller": METHODS[name].label,
        "plant": plant,
        "spread": spread,
        "seed": seed,
        "outcome": outcome(trace),
        "tip_start_mm": float(tip[0]),
        "rcm_start_mm": float(rcm[0]),
        "tip_1_mm_from_s": within_from_s(t, tip, CONVERGED_MM) if done else None,
        "rcm_1_mm_from_s": within_from_s(t, rcm, CONVERGED_MM) if done else None,
        "tip_rate_per_s": _rate(t, tip) if done else None,
        "rcm_rate_per_s": _rate(t, rcm) if done else None,
        "tip_end_mm": float(tip[-1]),
        "rcm_end_mm": float(rcm[-1]),
    }


Starts = dict[tuple[str, str, str, int], Trace]


def run_starts(
    names: Iterable[str], plant: str, spread: str, seeds: Sequence[int], progress: Progress
) -> Starts:
    """A run for each controller and seed."""
    runs: Starts = {}
    for name in names:
        progress(f"{len(seeds)} random starts, {plant} plant, {spread}: {METHODS[name].label}")
        setup = prepared(name, plant)
        for seed in seeds:
            runs[name, plant, spread, seed] = run_start(setup, SPREADS[spread], seed)
    return runs


def starts_table(runs: Starts) -> list[Row]:
    """Every run."""
    return [start_row(*key, trace) for key, trace in runs.items()]


_MEDIANS = ("tip_1_mm_from_s", "rcm_1_mm_from_s", "tip_rate_per_s", "rcm_rate_per_s")


def summary_table(rows: Sequence[Row]) -> list[Row]:
    """Counts, medians and the slowest of each group; a run that fails is counted, not averaged."""
    groups: dict[tuple[str, str, str], list[Row]] = {}
    for row in rows:
        key = str(row["controller"]), str(row["plant"]), str(row["spread"])
        groups.setdefault(key, []).append(row)
    return [_summary(*key, group) for key, group in groups.items()]


def _summary(controller: str, plant: str, spread: str, group: Sequence[Row]) -> Row:
    values = {name: [number(row, name) for row in group if row[name] is not None] for name in _MEDIANS}
    medians = {f"{name}_median": float(np.median(found)) if found else None for name, found in values.items()}
    both = [row for row in group if None not in (row["tip_1_mm_from_s"], row["rcm_1_mm_from_s"])]
    return {
        "plant": plant,
        "spread": spread,
        "controller": controller,
        "runs": len(group),
        "completed": sum(row["outcome"] == "completed" for row in group),
        "converged": len(both),
        **medians,
        "tip_1_mm_from_s_slowest": max(values["tip_1_mm_from_s"], default=None),
        "rcm_1_mm_from_s_slowest": max(values["rcm_1_mm_from_s"], default=None),
    }
