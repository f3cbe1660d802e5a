"""The time that the calling thread has computed, from compiled code."""

import time

import numpy as np
from numba import types

from surgsim.compiled import compiled

_CLOCK = getattr(time, "CLOCK_THREAD_CPUTIME_ID", 3)
_clock_gettime = types.ExternalFunction("clock_gettime", types.int32(types.int32, types.intp))


@compiled
def thread_time() -> float:
    """CPU time of this thread [s]; NaN where the system does not tell."""
    now = np.zeros(2, dtype=np.int64)
    if _clock_gettime(_CLOCK, now.ctypes.data) != 0:
        return np.nan
    return now[0] + 1e-9 * now[1]
