"""The manipulability paper's numbers, homes, paths, controllers, and what is measured of a run."""

import json
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from surgsim.metrics.accuracy import rms
from surgsim.metrics.optimality import attainable_manipulability
from surgsim.scenario.schema import Scenario
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import Setup, prepare
from surgsim.studies.manipulability_validation.calibrate import HOMES_RAD, STEPS
from surgsim.studies.measures import outcome
from surgsim.studies.study import Array, Curves, Paper, Printed, Results, SimulatedCase
from surgsim.studies.tables import Row
from surgsim.tasks.base import Feedback, Task, TimedTask, TipCommand
from surgsim.tasks.profile import Profile
from surgsim.trace.trace import Trace

PATHS = ("circle", "sinusoid", "spiral")
HOMES = (1, 2, 3, 4)


def _by_path(*rows: tuple[float, ...]) -> dict[str, tuple[float, ...]]:
    """Numbers of homes 1 to 4 by path."""
    return dict(zip(PATHS, rows, strict=True))


PAPER = Paper(
    title="Experimental Validation of Manipulability Optimization Control of a 7-DoF Serial Manipulator for "
    "Robot-assisted Surgery",
    reference="Su et al.",
    printed={
        "pinv": Printed(
            "Table 4, averages of mu, not optimised",
            "m^3",
            _by_path(
                (0.0406, 0.0282, 0.0246, 0.0356),
                (0.0447, 0.0281, 0.0222, 0.0233),
                (0.0393, 0.0280, 0.0253, 0.0342),
            ),
        ),
        "rnn": Printed(
            "Table 4, averages of mu, optimised",
            "m^3",
            _by_path(
                (0.0448, 0.0287, 0.0264, 0.0466),
                (0.0512, 0.0303, 0.0249, 0.0363),
                (0.0429, 0.0282, 0.0262, 0.0465),
            ),
        ),
        "increase": Printed(
            "Table 4, increase",
            "m^3",
            _by_path(
                (0.0042, 0.0005, 0.0018, 0.0110),
                (0.0065, 0.0022, 0.0027, 0.0130),
                (0.0036, 0.0003, 0.0010, 0.0123),
            ),
        ),
        "percent": Printed(
            "Table 4, increase",
            "%",
            _by_path((10.3, 1.8, 7.3, 30.9), (14.5, 7.8, 12.2, 55.8), (9.2, 1.1, 3.9, 36.0)),
        ),
        "pinv_error": Printed(
            "Table 5, root mean square tip errors, pseudo-inverse",
            "1e-4 m",
            _by_path(
                (1.148, 1.189, 1.162, 1.161), (2.588, 2.062, 1.980, 3.760), (3.891, 3.818, 4.151, 3.590)
            ),
        ),
        "rnn_error": Printed(
            "Table 5, root mean square tip errors, optimised",
            "1e-4 m",
            _by_path(
                (3.992, 3.876, 2.433, 1.967), (5.657, 5.074, 3.072, 3.398), (5.964, 4.934, 4.389, 3.778)
            ),
        ),
    },
)

DURATION_S = 10.0
PERIOD_S = DURATION_S / STEPS
RAMP_S = {"paper": 1e-6, "smooth": 0.5}
SAMPLES = 41
TABLE_5_UNITS_PER_M = 1e4

_NETWORK = {"c0": 1.0, "c1": 1.0, "c2": 1.0, "c3": 0.04, "epsilon_s": 6e-4}
RESOLVERS: dict[str, dict[str, Any]] = {
    "pinv": {"type": "pinv", "k_tip": 0.0, "rcm": False},
    "rnn": {"type": "rnn", "k_tip": 0.0, "rcm": False, **_NETWORK},
    "self_motion": {"type": "self_motion", "k_tip": 1.0 / PERIOD_S},
}
"""The network is eq. (6)-(9), with constants that the paper does not print: see the page's conventions."""


def table_4_averages(home: int) -> Array:
    """Table 4's averages (6,): not optimised on circle, sinusoid and spiral, then optimised."""
    return np.array([PAPER[name][path][home - 1] for name in ("pinv", "rnn") for path in PATHS])


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
    """

    path: str
    home: int
    method: str
    timing: Literal["paper", "smooth"] = "paper"
    dh_variant: Literal["standard", "literal"] = "standard"
    form: str | None = None
    constants: tuple[tuple[str, float], ...] = ()

    @property
    def label(self) -> str:
        """In words."""
        variant = ", d2 = 0.2" if self.dh_variant == "literal" else ""
        signs = f", eq. (7) {self.form} {dict(self.constants)}" if self.form else ""
        return f"{self.path}, home {self.home}: {self.method}, {self.timing} timing{variant}{signs}"

    def scenario(self) -> Scenario:
        """The scenario.

        The bounds Omega let a joint come to its limit within one step (gain 1/T), so that they act only where
        a joint would leave its range; self-motion keeps the default gain, with which it can brake in time.
        """
        form = {"form": self.form} if self.form else {}
        data = {
            "name": f"{self.path}_home{self.home}_{self.method}",
            "robot": {"name": "lwr4plus", "dh_variant": self.dh_variant},
            "instrument": None,
            "theatre": False,
            "start": {"q_rad": HOMES_RAD[self.home]},
            "plant": {"type": "kinematic"},
            "simulation": {"timestep_s": PERIOD_S, "control_period_s": PERIOD_S},
            "task": {
                "type": self.path,
                "duration_s": DURATION_S,
                "ramp_s": RAMP_S[self.timing],
                "hold_start_s": 0.0,
                "hold_end_s": 0.0,
            },
            "controller": {
                "name": self.method,
                "resolver": {**RESOLVERS[self.method], **form, **dict(self.constants)},
                "position_gain_per_s": 10.0 if self.method == "self_motion" else 1.0 / PERIOD_S,
            },
        }
        return Scenario.model_validate_json(json.dumps(data))

    def setup(self) -> Setup:
        """Ready to run; with the paper's timing the task gives the velocity of eq. (2)."""
        setup = prepare(self.scenario())
        return setup if self.timing == "smooth" else replace(setup, task=SteppedTask(setup.task))

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
            "last_step": round(trace.meta.ending.t_s / PERIOD_S),
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


def tip_errors(trace: Trace) -> tuple[Array, Array]:
    """Matched errors |p(k) - r(k)| and lagged ones |p(k-1) - r(k)| for k = 1..N [m].

    Position and desired position of the same step; the new desired position against the position before it.
    """
    tip, wanted = trace.block("tip"), trace.block("tip_ref")[1:]
    matched, lagged = (np.linalg.norm(p - wanted, axis=1) for p in (tip[1:], tip[:-1]))
    return np.asarray(matched), np.asarray(lagged)


def acceleration_ratio(trace: Trace) -> float:
    """Largest change of joint velocity in one step, from rest on, over what the acceleration limit allows."""
    steps = np.diff(trace.block("v"), axis=0) / trace.meta.control_period_s
    return float(np.max(np.abs(steps) / np.array(trace.meta.limits["acceleration"])))


def attainable(smooth: Iterable[Curves], ours: Curves) -> dict[str, Array]:
    """Largest mu that self-motion reaches along a path, at every step (steps + 1,) of a run by its timing.

    At each sample the largest that was found from any of the smooth runs, and by our run itself: the runs
    have the same tip positions at the same rows, so that what one of them finds another could have reached.
    Between samples mu* is interpolated linearly.
    """
    every, best = np.arange(STEPS + 1), np.max([curves["attainable"] for curves in smooth], axis=0)
    mu = np.maximum(np.interp(every, ours["attainable_step"], best), ours["mu"])
    profile = Profile(hold_start_s=0.0, duration_s=DURATION_S, ramp_s=RAMP_S["smooth"], hold_end_s=0.0)
    progress = np.array([profile.progress(k * PERIOD_S)[0] for k in every])
    return {"smooth": mu, "paper": np.interp(np.linspace(0.0, 1.0, STEPS + 1), progress, mu)}


def upper_bound(results: Results, path: str, home: int) -> dict[str, Array]:
    """mu* along a path by timing (steps + 1,)."""
    pinv, ours = (results.of(Cell(path, home, method, "smooth")) for method in ("pinv", "self_motion"))
    return attainable((pinv.curves, ours.curves), ours.curves)


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


class SteppedTask(TimedTask):
    """A task whose velocity is the step to the next sample over the period, eq. (2).

    The mean velocity of a step, where the task itself gives the velocity at its beginning. With the latter
    the tip would run along the tangents and off a curved path by about half a step.
    """

    def __init__(self, task: Task) -> None:
        self._task = task

    @property
    def duration_s(self) -> float:
        """Length of the whole task [s]."""
        return self._task.duration_s

    def command(self, t_s: float, feedback: Feedback | None = None) -> TipCommand:
        """Desired position at `t_s` [s] and (r(k+1) - r(k)) / T."""
        here = self._task.command(t_s).p_WTd
        there = self._task.command(t_s + PERIOD_S).p_WTd
        return TipCommand(p_WTd=here, v_WTd=(there - here) / PERIOD_S, a_WTd=np.zeros(3))
