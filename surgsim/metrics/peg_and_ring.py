"""Peg and ring: how many rings came to their pegs, how fast, with how much force.

Undefined (NaN) for a trace without a peg board.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from surgsim.metrics.metric import FORCE_RESOLUTION, PEG_TRANSFER_SECOND, Metric, with_block
from surgsim.trace.trace import Trace

GRASPED, ON_TARGET = 1.0, 2.0
"""Values of the columns `ring_state_{1..n}`."""


def of_board(compute: Callable[[Trace], float], rows: int = 1) -> Callable[[Trace], float]:
    """`compute`, for traces with a peg board and at least so many rows."""
    return with_block("ring_state", compute, rows)


def at_end(trace: Trace) -> NDArray[np.bool_]:
    """Which rings are on a target at the end."""
    found: NDArray[np.bool_] = trace.block("ring_state")[-1] == ON_TARGET
    return found


def rings_transferred(trace: Trace) -> float:
    """Rings that rest on a target peg at the end."""
    return float(np.count_nonzero(at_end(trace)))


def rings_transferred_fraction(trace: Trace) -> float:
    """The same over the number of rings."""
    return float(np.mean(at_end(trace)))


def transfer_time_s(trace: Trace) -> float:
    """Mean time from a ring's first grasp until it rests on its target for good [s]; NaN if none does."""
    states, times = trace.block("ring_state"), []
    for ring in np.flatnonzero(at_end(trace)):
        grasped = np.flatnonzero(states[:, ring] == GRASPED)
        away = np.flatnonzero(states[:, ring] != ON_TARGET)
        if grasped.size:
            times.append(trace["t_s"][away[-1] + 1] - trace["t_s"][grasped[0]])
    return float(np.mean(times)) if times else math.nan


def ring_drops(trace: Trace) -> float:
    """Rings that slipped out of the jaws, or were let go and came to rest on no peg."""
    return float(trace["ring_drop_count"][-1])


def peg_contact_force_max_n(trace: Trace) -> float:
    """Largest force on the jaws: of the board, the pegs and the rings, the held one's weight included [N]."""
    return float(np.max(trace["jaws_load_n"]))


METRICS = (
    Metric(
        name="rings_transferred",
        heading="rings transferred",
        meaning="rings that rest on a target peg at the end",
        compute=of_board(rings_transferred),
        lower_is_better=False,
    ),
    Metric(
        name="rings_transferred_fraction",
        heading="rings transferred, share",
        meaning="the same over the number of rings",
        compute=of_board(rings_transferred_fraction),
        lower_is_better=False,
    ),
    Metric(
        name="transfer_time_s",
        heading="time for a ring, mean [s]",
        matters=0.1,
        matters_source=PEG_TRANSFER_SECOND,
        meaning="mean time from a ring's first grasp until it rests on its target peg",
        compute=of_board(transfer_time_s),
    ),
    Metric(
        name="ring_drops",
        heading="rings dropped",
        meaning="rings that slipped out of the jaws, or were let go and came to rest on no peg",
        compute=of_board(ring_drops),
    ),
    Metric(
        name="peg_contact_force_max_n",
        heading="force on the jaws, largest [N]",
        matters=0.05,
        matters_source=FORCE_RESOLUTION,
        meaning="largest force of board, pegs and rings on the jaws",
        compute=of_board(peg_contact_force_max_n),
    ),
)
