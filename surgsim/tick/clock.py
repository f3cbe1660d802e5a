"""The time that the calling thread has computed, from compiled code."""

import time
from typing import Any

import numpy as np
from numba import types
from numba.extending import overload

from surgsim.compiled import compiled

_CLOCK = getattr(time, "CLOCK_THREAD_CPUTIME_ID", 3)
_clock_gettime: Any = types.ExternalFunction("clock_gettime", types.int32(types.int32, types.intp))


def _now() -> float:
    """The same in Python."""
    return time.clock_gettime(_CLOCK) if hasattr(time, "clock_gettime") else np.nan


@compiled
def _now_compiled() -> float:
    now = np.zeros(2, dtype=np.int64)
    if _clock_gettime(_CLOCK, now.ctypes.data) != 0:
        return np.nan
    seconds: float = now[0] + 1e-9 * now[1]
    return seconds


@overload(_now)
def _now_in_kernels() -> Any:
    def now() -> Any:
        return _now_compiled()

    return now


@compiled
def thread_time() -> float:
    """CPU time of this thread [s]; NaN where the system does not tell."""
    return _now()
