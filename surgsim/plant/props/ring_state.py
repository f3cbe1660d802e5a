"""Where each ring is, told from its place and motion."""

import math
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from surgsim.compiled import compiled

Array = NDArray[np.float64]

REST_M_PER_S = 0.005
REST_RAD_PER_S = 0.5
REST_S = 0.05


class RingState(IntEnum):
    """Where a ring is."""

    ON_SOURCE = 0
    GRASPED = 1
    ON_TARGET = 2
    ELSEWHERE = 3


@compiled
def time_at_rest(rest_s: Array, twist: Array, held: int, step_s: float) -> None:
    """Add `step_s` to the time that each ring out of the jaws has been at rest, or begin anew.

    Args:
        rest_s: Time at rest (n,) [s], changed in place.
        twist: Velocity of each ring (n, 6) [m/s, rad/s].
        held: The ring in the jaws, or -1.
        step_s: Time since the last call [s].
    """
    for i in range(len(rest_s)):
        v, w = twist[i, :3], twist[i, 3:]
        slow = v @ v < REST_M_PER_S**2 and w @ w < REST_RAD_PER_S**2
        rest_s[i] = rest_s[i] + step_s if slow and i != held else 0.0


@compiled
def find_states(
    states: Array,
    rest_s: Array,
    positions: Array,
    held: int,
    origin: Array,
    R_BW: Array,
    pegs: Array,
    reach: Array,
) -> None:
    """Fill the rings' states.

    Args:
        states: `RingState` of each ring (n,), changed in place.
        rest_s: How long each has been at rest (n,) [s].
        positions: Their middles, world frame (n, 3) [m].
        held: The ring in the jaws, or -1.
        origin: Origin of the board, world frame (3,) [m].
        R_BW: World in the board's frame (3, 3).
        pegs: Places on the board (2m, 2) [m]: m sources, then m targets.
        reach: How far beside a peg, and how far above the board, a ring's middle may be [m].
    """
    for i in range(len(states)):
        if i == held:
            states[i] = 1.0
            continue
        states[i] = 3.0
        p = R_BW @ (positions[i] - origin)
        if p[2] >= reach[1]:
            continue
        for k in range(len(pegs)):
            if math.hypot(p[0] - pegs[k, 0], p[1] - pegs[k, 1]) < reach[0]:
                if 2 * k < len(pegs):
                    states[i] = 0.0
                elif rest_s[i] > REST_S:
                    states[i] = 2.0
