"""Measures of a trace that a study may take."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surgsim.array import Array
from surgsim.metrics.accuracy import rms
from surgsim.studies.tables import Row
from surgsim.trace.trace import Trace


def outcome(trace: Trace) -> str:
    """How the run ended."""
    return trace.meta.ending.outcome.name.lower()


def tracking(trace: Trace) -> Row:
    """Outcome, its time [s], RMS and largest tip and RCM error [mm], mean of mu [m^3]; until a stop."""
    active = trace.active()
    errors = {name: 1e3 * active[f"{name}_error_m"] for name in ("tip", "rcm")}
    return {
        "outcome": outcome(trace),
        "end_s": trace.meta.ending.t_s,
        **{f"{name}_rms_mm": rms(error) for name, error in errors.items()},
        **{f"{name}_max_mm": float(error.max()) for name, error in errors.items()},
        "mu_mean": float(np.mean(active["manipulability"])),
    }


def within_from_s(t: Array, error: NDArray[np.floating[Any]], threshold: float) -> float | None:
    """Time from which `error` stays at or below `threshold`; None if it does not."""
    late = np.flatnonzero(~(error <= threshold))
    if late.size == 0:
        return 0.0
    last = int(late[-1])
    return float(t[last + 1]) if last + 1 < len(t) else None


def decay_rate(t: Array, error: Array, share: float) -> float | None:
    """Rate [1/s] of the exponential that reaches `share` of its start when `error` does; None if never."""
    time = within_from_s(t, error, share * float(error[0]))
    return math.log(1.0 / share) / time if time else None
