"""Random initial configurations whose convergence to a path's start is measured."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np

from surgsim.array import Array
from surgsim.control.rcm import rcm_kinematics
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import Setup, prepare
from surgsim.studies.figure import Axes, formula, label
from surgsim.studies.measures import decay_rate, outcome, within_from_s
from surgsim.studies.study import Results, SimulatedCase
from surgsim.studies.tables import Row, Tables, groups, numbers, pick
from surgsim.trace.trace import Trace

LEFT, CONVERGED_MM = 0.05, 1.0
_MEDIANS = ("tip_1_mm_from_s", "rcm_1_mm_from_s", "tip_rate_per_s", "rcm_rate_per_s")


class Spread(NamedTuple):
    """How far random starts are off.

    The standard deviation of the joints' displacement [rad], and smallest and largest distance [mm] of the
    tip from the path's start and of the shaft from the trocar.
    """

    deviation_rad: float
    tip_mm: tuple[float, float]
    rcm_mm: tuple[float, float]

    def draw(self, setup: Setup, seed: int) -> Array:
        """Joint positions (n,) [rad] inside the limits whose tip and shaft are displaced that far."""
        rng, limits = np.random.default_rng(seed), setup.arm.limits
        here, p_WC = setup.arm.kinematics(setup.q_start).p_WT, setup.plant.reset(setup.q_start).p_WC
        while True:
            q = setup.q_start + self.deviation_rad * rng.standard_normal(setup.q_start.size)
            kin = setup.arm.kinematics(q)
            tip = 1e3 * float(np.linalg.norm(kin.p_WT - here))
            rcm = 1e3 * float(np.linalg.norm(rcm_kinematics(kin, p_WC, np.zeros(3)).error))
            inside = bool((q > limits.q_min).all() and (q < limits.q_max).all())
            if inside and _between(tip, self.tip_mm) and _between(rcm, self.rcm_mm):
                return q


def _between(value: float, bounds: tuple[float, float]) -> bool:
    return bounds[0] <= value <= bounds[1]


@dataclass(frozen=True)
class RandomStart(SimulatedCase):
    """A random initial configuration; a study gives the scenario, which holds the path's start.

    Attributes:
        method: Which controller.
        plant: Type of the plant.
        spread: Which of `spreads`.
        seed: Of the configuration.
        spreads: How far starts are off, by name.
        names: What tables call each method.
        watched_s: How long it is watched [s].
    """

    method: str
    plant: str
    spread: str
    seed: int

    spreads: ClassVar[dict[str, Spread]] = {}
    names: ClassVar[dict[str, str]] = {}
    watched_s: ClassVar[float] = 3.0

    def run(self) -> Trace:
        """The first seconds."""
        setup = prepare(self.scenario())
        start = self.spreads[self.spread].draw(setup, self.seed)
        simulation = Simulation(replace(setup, q_start=start))
        simulation.advance(round(self.watched_s / setup.scenario.simulation.control_period_s))
        return simulation.trace()

    def measures(self, trace: Trace) -> Row:
        """Displacement, convergence to 1 mm, equivalent rates."""
        t, done = trace["t_s"], outcome(trace) == "completed"
        found = {"tip": 1e3 * trace["tip_error_m"], "rcm": 1e3 * trace["rcm_error_m"]}
        near = {name: within_from_s(t, e, CONVERGED_MM) for name, e in found.items()}
        return {
            "controller": self.names[self.method],
            "plant": self.plant,
            "spread": self.spread,
            "seed": self.seed,
            "outcome": outcome(trace),
            **{f"{name}_start_mm": float(e[0]) for name, e in found.items()},
            **{f"{name}_1_mm_from_s": time if done else None for name, time in near.items()},
            **{f"{name}_rate_per_s": decay_rate(t, e, LEFT) if done else None for name, e in found.items()},
            **{f"{name}_end_mm": float(e[-1]) for name, e in found.items()},
        }


def starts_table(every: Sequence[Row]) -> list[Row]:
    """Counts, medians and the slowest of each group; a run that fails is counted, not averaged."""
    table: list[Row] = []
    for key, rows in groups(every, "plant", "spread", "controller").items():
        values = {name: numbers(rows, name) for name in _MEDIANS}
        both = [row for row in rows if None not in (row["tip_1_mm_from_s"], row["rcm_1_mm_from_s"])]
        counts = {"completed": len(pick(rows, outcome="completed")), "converged": len(both)}
        medians = {f"{name}_median": float(np.median(v)) if v else None for name, v in values.items()}
        slowest = {f"{name}_slowest": max(values[name], default=None) for name in _MEDIANS[:2]}
        named = dict(zip(("plant", "spread", "controller"), key, strict=True))
        table.append({**named, "runs": len(rows), **counts, **medians, **slowest})
    return table


def draw_starts(methods: Mapping[str, tuple[str, str]], axes: Axes, results: Results, _: Tables) -> None:
    """Both errors of the starts that have curves, a column of axes for each method: its name and colour."""
    t = np.linspace(0.0, RandomStart.watched_s, 50)
    for column, (name, (_title, colour)) in zip(axes.T, methods.items(), strict=True):
        near = [found.curves for found in results["starts"] if found.case.method == name and found.curves]
        for ax, error, size in zip(column, ("tip_error_m", "rcm_error_m"), (20.0, 10.0), strict=True):
            for curves in near:
                ax.semilogy(curves["t_s"], 1e3 * curves[error], color=colour, linewidth=0.8, alpha=0.6)
            formula(ax, t, size * np.exp(-5.0 * t), "exp(-k t), k1 = k2 = 5 1/s")
            ax.set_ylim(1e-4, 60.0)
    label(axes, "time (s)", ["tip error (mm)", "RCM error (mm)"], [title for title, _ in methods.values()])
    axes[0, 0].legend(frameon=False, fontsize=9.5, loc="upper right")
