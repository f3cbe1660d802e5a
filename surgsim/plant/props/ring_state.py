"""Where each ring is, told from its place and motion."""

import math
from enum import IntEnum

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.tick.algebra import dot

REST_M_PER_S = 0.005
REST_RAD_PER_S = 0.5
REST_S = 0.05


class RingState(IntEnum):
    """Where a ring is."""

    ON_SOURCE = 0
    GRASPED = 1
    ON_TARGET = 2
    ELSEWHERE = 3


ON_SOURCE, GRASPED, ON_TARGET, ELSEWHERE = (float(state) for state in RingState)
"""The states as they are recorded."""


@compiled
def add_rest(rest_s: float, twist: Array, is_held: bool, step_s: float) -> float:
    """The time that a ring has been at rest, `step_s` later; zero in the jaws or in motion.

    Args:
        rest_s: So far [s].
        twist: Velocity of the ring (6,) [m/s, rad/s].
        is_held: Whether it is in the jaws.
        step_s: Time since the last call [s].
    """
    v, w = dot(twist[:3], twist[:3]), dot(twist[3:], twist[3:])
    slow = v < REST_M_PER_S * REST_M_PER_S and w < REST_RAD_PER_S * REST_RAD_PER_S
    return rest_s + step_s if slow and not is_held else 0.0


@compiled
def place_of(p: Array, rest_s: float, pegs: Array, beside: float, below: float) -> float:
    """`RingState` of a ring that is not in the jaws.

    Args:
        p: Its middle in the board's frame (3,) [m].
        rest_s: How long it has been at rest [s].
        pegs: Places on the board (2m, 2) [m]: m sources, then m targets.
        beside: How far beside a peg its middle may be [m].
        below: How far above the board [m].
    """
    state = ELSEWHERE
    if p[2] >= below:
        return state
    for k in range(len(pegs)):
        x, y = p[0] - pegs[k, 0], p[1] - pegs[k, 1]
        if math.sqrt(x * x + y * y) < beside:
            if 2 * k < len(pegs):
                state = ON_SOURCE
            elif rest_s > REST_S:
                state = ON_TARGET
    return state
