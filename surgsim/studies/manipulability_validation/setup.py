"""The experiment as data: homes, paths, controllers and conventions, each with where it comes from."""

import json
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from surgsim.scenario.schema import Scenario
from surgsim.simulate.setup import Setup, prepare
from surgsim.tasks.base import Feedback, Task, TimedTask, TipCommand

Method = Literal["pinv", "rnn", "self_motion"]
Timing = Literal["paper", "smooth"]
DhVariant = Literal["standard", "literal"]

STEPS = 1000
DURATION_S = 10.0
PERIOD_S = DURATION_S / STEPS
STEP_RAMP_S = 1e-6
SMOOTH_RAMP_S = 0.5

HOMES_RAD: dict[int, tuple[float, ...]] = {
    1: (-1.4554, 0.2298, -1.4327, 1.1228, -1.0211, -0.7746, 0.0),
    2: (-2.6363, -0.2700, -1.0263, -0.6707, 1.7487, -1.4718, 0.0),
    3: (-0.4316, 0.4505, -2.3141, -0.2694, 1.5694, -1.8793, 0.0),
    4: (-0.1466, 0.0373, -1.3932, -1.7828, 0.7078, 1.3767, 0.0),
}
"""Joint positions q1..q7 [rad]. The paper does not print its own; q7 moves neither flange nor mu."""

_SEARCH = "seeded search of calibrate.py, every run inside the joint limits"
_EARLIER = "an earlier search with the same objective without the joint limits; its runs are inside them"
HOME_SOURCES: dict[int, str] = {1: _SEARCH, 2: _EARLIER, 3: _SEARCH, 4: _EARLIER}

GIVEN_UP_HOMES_RAD: dict[int, tuple[float, ...]] = {
    1: (2.6604, 0.2809, 1.9706, -1.7499, 0.2555, -1.0495, 0.0),
    3: (0.7051, 0.4350, -2.6527, 0.0696, 1.2719, -1.9953, 0.0),
}
"""Homes of the earlier search that leave the joint range along the sinusoid."""

NETWORK: dict[str, Any] = {
    "type": "rnn",
    "c0": 1.0,
    "c1": 1.0,
    "c2": 1.0,
    "c3": 0.04,
    "epsilon_s": 6e-4,
    "k_tip": 0.0,
    "rcm": False,
}
"""Eq. (6)-(9) with constants that the paper does not print: see `CONVENTIONS`."""

RESOLVERS: dict[Method, dict[str, Any]] = {
    "pinv": {"type": "pinv", "k_tip": 0.0, "rcm": False},
    "rnn": NETWORK,
    "self_motion": {"type": "self_motion", "k_tip": 1.0 / PERIOD_S},
}

CONVENTIONS: tuple[tuple[str, str, str], ...] = (
    ("steps, N", "1000", "section 3.1"),
    (
        "duration",
        "10 s, so one step is 10 ms",
        "chosen: the paper gives none, and only (c3/c2) T matters for mu",
    ),
    ("circle", "R = 2 cm in the xy plane, from its point furthest along x", "R: Table 1; plane: chosen"),
    (
        "sinusoid",
        "A = 1 cm along y, L = 25 cm along x, 2 periods",
        "A, L: Table 1; axes and periods: chosen",
    ),
    (
        "spiral",
        "R = 1 cm, L = 5 cm along z, 6 turns",
        "R, L: Table 1; axis: chosen; turns: 6 steps as long as Table 5 has them",
    ),
    ("mu", "sqrt(det(J J^T)) of the 3x7 translational Jacobian", "eq. (1); 3x7 or 6x7 is not said"),
    ("tip", "the flange, no instrument", "an instrument makes mu several times larger than Table 4"),
    ("DH", "Table 3 with d2 = 0", "d2 = 0.2 is a misprint; shown as a variant"),
    ("velocity", "(r(k+1) - r(k)) / T", "eq. (2)"),
    ("position", "q(k+1) = q(k) + T q'(k), no feedback", "eq. (3)-(5)"),
    ("c0, c1, c2", "1", "chosen: no visible effect on mu at a given c3/c2"),
    ("c3", "0.04", "calibrated with the homes on Table 4"),
    (
        "epsilon",
        "6e-4 s",
        "calibrated on the circle's optimised errors of Table 5, which are proportional to it",
    ),
    ("averages", "over steps 1 to 1000", "chosen: the start is common to all methods"),
)
"""What is assumed, and where it comes from."""


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One run of the study.

    Attributes:
        path: `circle`, `sinusoid` or `spiral`.
        home: Number of the home, 1 to 4.
        method: Which resolver.
        timing: `paper` is constant path speed from the first step, with finite-difference velocity;
            `smooth` leaves and reaches rest with ramps, which an arm with limited accelerations needs.
        dh_variant: `literal` has d2 = 0.2 m.
    """

    path: str
    home: int
    method: Method
    timing: Timing = "paper"
    dh_variant: DhVariant = "standard"


def scenario(cell: Cell, **network: float | str) -> Scenario:
    """The scenario of a cell; `network` changes keys of its resolver.

    The bounds Omega let a joint come to its limit within one step (gain 1/T), so that they act only where a
    joint would leave its range; self-motion keeps the default gain, with which it can brake in time.
    """
    ours = cell.method == "self_motion"
    data = {
        "name": f"{cell.path}_home{cell.home}_{cell.method}",
        "robot": {"name": "lwr4plus", "dh_variant": cell.dh_variant},
        "instrument": None,
        "theatre": False,
        "start": {"q_rad": HOMES_RAD[cell.home]},
        "plant": {"type": "kinematic"},
        "simulation": {"timestep_s": PERIOD_S, "control_period_s": PERIOD_S},
        "task": {
            "type": cell.path,
            "duration_s": DURATION_S,
            "ramp_s": STEP_RAMP_S if cell.timing == "paper" else SMOOTH_RAMP_S,
            "hold_start_s": 0.0,
            "hold_end_s": 0.0,
        },
        "controller": {
            "name": cell.method,
            "resolver": {**RESOLVERS[cell.method], **network},
            "position_gain_per_s": 10.0 if ours else 1.0 / PERIOD_S,
        },
    }
    return Scenario.model_validate_json(json.dumps(data))


def prepared(cell: Cell, **network: float | str) -> Setup:
    """A cell ready to run; with the paper's timing its task gives the velocity of eq. (2)."""
    setup = prepare(scenario(cell, **network))
    if cell.timing == "smooth":
        return setup
    return replace(setup, task=SteppedTask(setup.task))


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
