"""Peg and ring as laparoscopic training is scored: success, misses, the way gone; and the shaft.

How smooth the tip moved is `sparc`. Undefined (NaN) for a trace without a peg board.
"""

import math

import numpy as np

from surgsim.array import Array
from surgsim.errors import Outcome
from surgsim.metrics.metric import CHOICE, FORCE_RESOLUTION, PEG_TRANSFER_SECOND, Metric, with_block
from surgsim.metrics.peg_and_ring import GRASPED, ON_TARGET, at_end, of_board
from surgsim.trace.trace import Trace


def transfer_success(trace: Trace) -> float:
    """1 if the run came to its end within its time limit with every ring on a target peg, else 0."""
    return float(trace.meta.ending.outcome is Outcome.COMPLETED and bool(at_end(trace).all()))


def _board(trace: Trace) -> dict[str, float]:
    """The keys of the peg board."""
    props = trace.meta.scenario["props"]
    found: dict[str, float] = next(prop for prop in props if prop["type"] == "peg_board")
    return found


def grasps_missed(trace: Trace) -> float:
    """How often the jaws closed past `close_at` and opened below `open_at` again without ever holding a ring.

    The last time counts too if they are closed at the end. NaN where no jaws were told anything.
    """
    if "jaw" not in trace:
        return math.nan
    board, jaw = _board(trace), trace["jaw"]
    holds = (trace.block("ring_state") == GRASPED).any(axis=1)
    missed, closed, held = 0, False, False
    for told, holding in zip(jaw, holds, strict=True):
        if closed and told < board["open_at"]:
            missed, closed = missed + (not held), False
        elif not closed and told >= board["close_at"]:
            closed, held = True, False
        held = held or bool(holding)
    return float(missed + (closed and not held))


def tip_path_length(trace: Trace) -> float:
    """Length of the tip's way [m]."""
    return float(np.linalg.norm(np.diff(trace.block("tip"), axis=0), axis=1).sum())


def shortest_way(trace: Trace) -> float:
    """Straight from the tip's start to the first ring, with it to where it rests, to the next, and so on [m].

    Of the rings on a target at the end, in the order in which they came to rest there; NaN without one.
    """
    states = trace.block("ring_state")
    rings = np.flatnonzero(at_end(trace))
    if not rings.size:
        return math.nan
    since = [int(np.flatnonzero(np.append(-1.0, states[:, ring]) != ON_TARGET)[-1]) for ring in rings]
    places: list[Array] = [trace.block("tip")[0]]
    for ring in rings[np.argsort(since, kind="stable")]:
        places += [trace.block(f"ring{ring + 1}")[0], trace.block(f"ring{ring + 1}")[-1]]
    return float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())


def economy_of_motion(trace: Trace) -> float:
    """The shortest way over the tip's way, 1 at best."""
    gone = tip_path_length(trace)
    return shortest_way(trace) / gone if gone > 0.0 else math.nan


METRICS = (
    Metric(
        name="transfer_success",
        heading="all rings transferred in time",
        meaning="1 if all rings rest on target pegs within the time limit, else 0",
        compute=of_board(transfer_success),
        lower_is_better=False,
    ),
    Metric(
        name="grasps_missed",
        heading="grasps missed",
        meaning="times that the jaws closed and opened again without a ring",
        compute=of_board(grasps_missed),
    ),
    Metric(
        name="tip_path_length_m",
        heading="way of the tip [m]",
        matters=0.01,
        matters_source=CHOICE,
        meaning="length of the tip's way, of a run with a peg board",
        compute=of_board(tip_path_length, rows=2),
    ),
    Metric(
        name="economy_of_motion",
        heading="economy of motion",
        matters=0.01,
        matters_source=CHOICE,
        meaning="straight way from ring to peg and on over the way that the tip went",
        compute=of_board(economy_of_motion, rows=2),
        lower_is_better=False,
    ),
    Metric(
        name="run_time_s",
        heading="time of the run [s]",
        matters=0.1,
        matters_source=PEG_TRANSFER_SECOND,
        meaning="time that a run with a peg board took, cut off by the time limit",
        compute=of_board(lambda trace: float(trace["t_s"][-1])),
    ),
    Metric(
        name="shaft_contact_force_max_n",
        heading="force on the shaft, largest [N]",
        matters=0.05,
        matters_source=FORCE_RESOLUTION,
        meaning="largest force of board, pegs and rings on the shaft, where it can touch",
        compute=with_block("shaft_load", lambda trace: float(np.max(trace["shaft_load_n"]))),
    ),
)
