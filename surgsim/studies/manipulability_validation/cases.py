"""The manipulability paper's runs and controllers, what is measured of a run, and random homes."""

import json
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, Literal

import numpy as np

from surgsim.array import Array
from surgsim.metrics.accuracy import rms
from surgsim.metrics.optimality import attainable_manipulability
from surgsim.scenario.schema import Scenario
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import Setup, prepare
from surgsim.studies.attainable import attainable_by_timing
from surgsim.studies.homes import RandomHome
from surgsim.studies.manipulability_validation.calibrate import (
    HOMES,
    HOMES_RAD,
    LIMITS_RAD,
    PATHS,
    STEPS,
)
from surgsim.studies.measures import outcome
from surgsim.studies.stepped import SteppedTask, acceleration_ratio, tip_errors
from surgsim.studies.study import Curves, Results, SimulatedCase
from surgsim.studies.tables import Row, number, numbers, pairs
from surgsim.tasks.profile import Profile
from surgsim.trace.trace import Trace

DURATION_S = 10.0
PERIOD_S = DURATION_S / STEPS
RAMP_S = {"paper": 1e-6, "smooth": 0.5}
_SMOOTH = Profile(hold_start_s=0.0, duration_s=DURATION_S, ramp_s=RAMP_S["smooth"], hold_end_s=0.0)
SAMPLES = 41
TABLE_5_UNITS_PER_M = 1e4

_NETWORK = {"c0": 1.0, "c1": 1.0, "c2": 1.0, "c3": 0.04, "epsilon_s": 6e-4}
RESOLVERS: dict[str, dict[str, Any]] = {
    "pinv": {"type": "pinv", "k_tip": 0.0, "rcm": False},
    "rnn": {"type": "rnn", "k_tip": 0.0, "rcm": False, **_NETWORK},
    "self_motion": {"type": "self_motion", "k_tip": 1.0 / PERIOD_S},
}
"""The network is eq. (6)-(9), with constants that the paper does not print: see the page's conventions."""


@dataclass(frozen=True)
class Cell(SimulatedCase):
    """One run: row k of its trace is the state after k steps.

    Attributes:
        path: `circle`, `sinusoid` or `spiral`.
        home: Number of the home, 1 to 4.
        method: Which resolver.
        timing: `paper` is constant path speed from the first step, with finite-difference velocity;
            `smooth` leaves and reaches rest with ramps, which an arm with limited accelerations needs.
        dh_variant: `literal` has d2 = 0.2 m.
        form: Signs of eq. (7), if not those of the derivation.
        constants: Constants of the network that are changed.
        steps: Number of steps, N.
        duration_s: Time of the path [s].
        q_rad: Joint positions of a home that is none of the four [rad].
    """

    path: str
    home: int
    method: str
    timing: Literal["paper", "smooth"] = "paper"
    dh_variant: Literal["standard", "literal"] = "standard"
    form: str | None = None
    constants: tuple[tuple[str, float], ...] = ()
    steps: int = STEPS
    duration_s: float = DURATION_S
    q_rad: tuple[float, ...] = ()

    @property
    def period_s(self) -> float:
        """Time of a step [s]."""
        return self.duration_s / self.steps

    @property
    def label(self) -> str:
        """In words."""
        variant = ", d2 = 0.2" if self.dh_variant == "literal" else ""
        signs = f", eq. (7) {self.form} {dict(self.constants)}" if self.form else ""
        steps = "" if self.steps == STEPS else f", {self.steps} steps in {self.duration_s:g} s"
        return f"{self.path}, home {self.home}: {self.method}, {self.timing} timing{variant}{signs}{steps}"

    def scenario(self) -> Scenario:
        """The scenario.

        The bounds Omega let a joint come to its limit within one step (gain 1/T), so that they act only where
        a joint would leave its range; self-motion keeps the default gain, with which it can brake in time.
        The paper's resolvers have no motion away from joint limits, so none is added.
        """
        form = {"form": self.form} if self.form else {}
        data = {
            "name": f"{self.path}_home{self.home}_{self.method}",
            "robot": {"name": "lwr4plus", "dh_variant": self.dh_variant},
            "instrument": None,
            "theatre": False,
            "start": {"q_rad": self.q_rad or HOMES_RAD[self.home]},
            "plant": {"type": "kinematic"},
            "simulation": {"timestep_s": self.period_s, "control_period_s": self.period_s},
            "task": {
                "type": self.path,
                "duration_s": self.duration_s,
                "ramp_s": RAMP_S[self.timing],
                "hold_start_s": 0.0,
                "hold_end_s": 0.0,
            },
            "controller": {
                "name": self.method,
                "resolver": {**RESOLVERS[self.method], **form, **dict(self.constants)},
                "position_gain_per_s": 10.0 if self.method == "self_motion" else 1.0 / self.period_s,
                "limit_zone_rad": 0.0,
            },
        }
        return Scenario.model_validate_json(json.dumps(data))

    def setup(self) -> Setup:
        """Ready to run; with the paper's timing the task gives the velocity of eq. (2)."""
        setup = prepare(self.scenario())
        return (
            setup if self.timing == "smooth" else replace(setup, task=SteppedTask(setup.task, self.period_s))
        )

    def run(self) -> Trace:
        """The trace."""
        return Simulation(self.setup()).run()

    def measures(self, trace: Trace) -> Row:
        """Averages over steps 1 to N, or to the step at which the run ended; errors, and joint limits."""
        matched, lagged = tip_errors(trace)
        step = np.linalg.norm(np.diff(trace.block("tip_ref"), axis=0), axis=1)
        q, limits = trace.block("q"), {name: np.array(x) for name, x in trace.meta.limits.items()}
        return {
            "path": self.path,
            "home": self.home,
            "mu_mean": float(np.mean(trace["manipulability"][1:])),
            "mu_6d_mean": float(np.mean(trace["manipulability_6d"][1:])),
            "matched_rms_m": rms(matched),
            "matched_max_m": float(matched.max()),
            "matched_peak_step": 1 + int(np.argmax(matched)),
            "lagged_rms_m": rms(lagged),
            "step_rms_m": rms(step),
            "position_margin_rad": float(np.min(np.minimum(q - limits["q_min"], limits["q_max"] - q))),
            "velocity_over_limit": float(np.max(np.abs(trace.block("v")) / limits["velocity"])),
            "acceleration_over_limit": acceleration_ratio(trace),
            "outcome": outcome(trace),
            "last_step": round(trace.meta.ending.t_s / self.period_s),
        }

    def curves(self, trace: Trace) -> Curves:
        """Manipulability, tip and errors by step; with smooth timing also mu* at its samples."""
        matched, lagged = tip_errors(trace)
        shown = {"mu": trace["manipulability"], "matched": matched, "lagged": lagged}
        shown |= {name: trace.block(name) for name in ("tip", "tip_ref")}
        if self.timing == "smooth":
            rows, best = attainable_manipulability(trace, SAMPLES)
            shown |= {"attainable": best, "attainable_step": np.array(rows)}
        return shown


def upper_bound(results: Results, path: str, home: int) -> dict[str, Array]:
    """mu* along a path by timing (steps + 1,)."""
    pinv, ours = (results.of(Cell(path, home, method, "smooth")) for method in ("pinv", "self_motion"))
    return attainable_by_timing((pinv.curves, ours.curves), ours.curves, STEPS, _SMOOTH)


PRINTED_NETWORKS = tuple(
    Cell("circle", 1, "rnn", form=form, constants=(("epsilon_s", epsilon_s), ("c1", c1)))
    for form, epsilon_s, c1 in (
        ("printed", 0.01, 1.0),
        ("printed", 0.001, 1.0),
        ("printed", 6e-4, 1.0),
        ("printed", 6e-4, 0.0),
        ("corrected", 6e-4, 0.0),
        ("corrected", 6e-4, 1.0),
    )
)
"""Signs and constants of eq. (7) that are tried; the last is the study's."""


FEWER_AND_MORE = (500, 2000, 5000)
"""Numbers of steps beside the paper's 1000."""


def stepped(path: str, home: int, method: str, steps: int, same_time: bool) -> Cell:
    """A cell in another number of steps, in the same time or with steps of the same time."""
    return Cell(path, home, method, steps=steps, duration_s=DURATION_S if same_time else steps * PERIOD_S)


DRAWN, DRAWN_QUICK, WANTED = 400, 3, 200
"""How many random homes are drawn, in a quick run too, and how many are wanted of those that count."""


@dataclass(frozen=True)
class UnfittedHome(RandomHome):
    """A random home; q7 moves neither flange nor mu."""

    seed, ranges_rad, paths = 730126, tuple(map(float, LIMITS_RAD)), PATHS

    def both(self) -> tuple[str, str]:
        """Pseudo-inverse and network."""
        return "pinv", "rnn"

    def follow(self, path: str, method: str) -> Row:
        """One run of the study from this home."""
        return Cell(path, 0, method, q_rad=(*self.draw(), 0.0)).measured().row


def printed_network(results: Results) -> list[Row]:
    """Where the network ends with the signs of eq. (7) as printed and as derived; home 1, circle."""
    return [
        {
            "eq_7": m.case.form,
            **dict(m.case.constants),
            **m.only("outcome", "last_step"),
            "tip_error_rms_m": m.row["matched_rms_m"] if m.row["outcome"] == "completed" else None,
            "tip_error_max_m": m.row["matched_max_m"],
        }
        for m in results["printed_network"]
    ]


def steps_table(results: Results) -> list[Row]:
    """Increase by the network over the twelve cells in another number of steps, and the tip errors."""
    rows: list[Row] = []
    for same_time, steps in product((True, False), sorted((*FEWER_AND_MORE, STEPS))):
        cells = [
            stepped(*place, m, steps, same_time) for place in product(PATHS, HOMES) for m in ("pinv", "rnn")
        ]
        if cells[0] in results and cells[-1] in results:
            found = [results.of(cell).row for cell in cells]
            mu = np.array([number(row, "mu_mean") for row in found]).reshape(-1, 2)
            tip = np.array([number(row, "matched_rms_m") for row in found]).reshape(-1, 2)
            percent = 100.0 * (mu[:, 1] / mu[:, 0] - 1.0)
            row: Row = {
                "kept": "time of the path" if same_time else "time of a step",
                "steps": steps,
                "duration_s": cells[0].duration_s,
                "least_percent": float(percent.min()),
                "median_percent": float(np.median(percent)),
                "most_percent": float(percent.max()),
                **{f"{m}_rms_mm": 1e3 * float(np.median(tip[:, i])) for i, m in enumerate(("pinv", "rnn"))},
            }
            rows.append(row)
    return rows


def attainable_table(results: Results) -> list[Row]:
    """How much of the attainable gain the network and our resolver reach, and our limits."""
    rows: list[Row] = []
    for (pinv, rnn), (start, ours) in zip(
        pairs(results.rows("paper")), pairs(results.rows("smooth")), strict=True
    ):
        bound = upper_bound(results, str(pinv["path"]), int(number(pinv, "home")))
        smooth, stepped = (float(np.mean(bound[timing][1:])) for timing in ("smooth", "paper"))
        base, network, slow, best = (number(row, "mu_mean") for row in (pinv, rnn, start, ours))
        limits = ("position_margin_rad", "velocity_over_limit", "acceleration_over_limit")
        rows.append(
            {
                "path": pinv["path"],
                "home": pinv["home"],
                "pinv": slow,
                "self_motion": best,
                "attainable": smooth,
                "fraction_rnn": (network - base) / (stepped - base),
                "fraction_self_motion": (best - slow) / (smooth - slow),
                "tip_rms_m": ours["matched_rms_m"],
                "tip_max_m": ours["matched_max_m"],
                **{name: ours[name] for name in limits},
                "pinv_paper_timing_acceleration": pinv["acceleration_over_limit"],
                "outcome": ours["outcome"],
            }
        )
    return rows


def increase_percent(pinv: Row, rnn: Row, column: str = "mu_mean") -> float:
    """By how much the second one has more [%]."""
    return 100.0 * (number(rnn, column) / number(pinv, column) - 1.0)


def variants(results: Results) -> list[Row]:
    """The same homes with d2 = 0.2 m as printed, and the 6x7 mu of the standard runs."""
    rows: list[Row] = []
    for standard, literal in zip(pairs(results.rows("paper")), pairs(results.rows("literal")), strict=False):
        row = {name: standard[0][name] for name in ("path", "home")}
        kinds = (("standard", standard, ""), ("d2_literal", literal, ""), ("6x7", standard, "6d_"))
        for name, (pinv, rnn), kind in kinds:
            row |= {f"{name}_pinv": pinv[f"mu_{kind}mean"], f"{name}_rnn": rnn[f"mu_{kind}mean"]}
            row[f"{name}_increase_percent"] = increase_percent(pinv, rnn, f"mu_{kind}mean")
        rows.append({**row, "d2_literal_margin_rad": min(numbers(literal, "position_margin_rad"))})
    return rows
