"""Calls measured in turn, in processor time of the calling thread."""

from collections.abc import Callable, Sequence

import numpy as np

from surgsim.array import Array
from surgsim.compiled.watch import thread_time_ns
from surgsim.plant.part import BLOCK_TICKS

CHUNK = BLOCK_TICKS
"""Ticks of a chunk: as many as a run enters its loop for, some milliseconds, so that neighbours in time see
the same machine."""


def thread_time_of(call: Callable[[], object]) -> float:
    """Processor time [s] of this thread in `call`, without compiling or loading kernels."""
    began = thread_time_ns()
    call()
    return 1e-9 * (thread_time_ns() - began)


def in_turn(calls: Sequence[Callable[[], object]], rounds: int) -> Array:
    """Times [s] of the calls in each round (rounds, len(calls)); a first round, not counted, warms up."""
    times = [[thread_time_of(call) for call in calls] for _ in range(rounds + 1)]
    return np.array(times[1:])
