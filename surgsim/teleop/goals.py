"""Steps of the simulated operator's program."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from surgsim.array import Array


@dataclass(frozen=True, kw_only=True)
class Goal:
    """One step of the operator's program, in remote tip coordinates.

    Attributes:
        position: Where the tip shall be (3,) [m]; may lie beyond a wall.
        tolerance_m: How near is near enough; half the target width of Fitts' law.
        dwell_s: How long the tip is to be seen there, or the push to last.
        jaw: Closing of the jaws during this goal, 0 open to 1 closed.
        push: Go there once, without correcting by sight, and stay for `dwell_s`.
        timeout_s: After this the operator gives up and takes the next goal.
        roll: How far the grip, and with it the instrument, is turned from the start [rad].
    """

    position: tuple[float, float, float]
    tolerance_m: float = 0.002
    dwell_s: float = 0.2
    jaw: float = 0.0
    push: bool = False
    timeout_s: float = math.inf
    roll: float = 0.0


PLACE, TOLERANCE, DWELL_TIME, CLOSED, PUSH, TIMEOUT, TURNED, GOAL = 0, 3, 4, 5, 6, 7, 8, 9
"""Where in a goal's row its numbers are, and its length."""


def goal_rows(goals: Sequence[Goal]) -> Array:
    """The goals as rows (k, 9)."""
    rows = [(*g.position, g.tolerance_m, g.dwell_s, g.jaw, float(g.push), g.timeout_s, g.roll) for g in goals]
    return np.array(rows).reshape(-1, GOAL)
