"""How well tip and shaft are where they should be."""

import numpy as np
from numpy.typing import NDArray

from surgsim.metrics.metric import CHOICE, REPEATABILITY, Metric
from surgsim.trace.trace import Trace

CONVERGED_TIP_M = 1e-3
CONVERGED_RCM_M = 5e-3


def rms(values: NDArray[np.float64]) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def convergence_time_s(trace: Trace) -> float:
    """Time from which the tip stays within 1 mm and the shaft within 5 mm [s]; NaN if never."""
    late = ~(trace["tip_error_m"] <= CONVERGED_TIP_M)
    if np.isfinite(trace["rcm_error_m"]).any():
        late = late | ~(trace["rcm_error_m"] <= CONVERGED_RCM_M)
    outside = np.flatnonzero(late)
    if outside.size == 0:
        return 0.0
    last = int(outside[-1])
    return float(trace["t_s"][last + 1]) if last + 1 < len(trace) else float("nan")


METRICS = (
    Metric(
        name="tip_error_rms_mm",
        heading="tip error, RMS [mm]",
        matters=0.1,
        matters_source=REPEATABILITY,
        meaning="RMS distance of the tip from its command at the same tick",
        compute=lambda trace: 1e3 * rms(trace["tip_error_m"]),
    ),
    Metric(
        name="tip_error_max_mm",
        heading="tip error, largest [mm]",
        matters=0.1,
        matters_source=REPEATABILITY,
        meaning="largest distance of the tip from its command",
        compute=lambda trace: 1e3 * float(np.max(trace["tip_error_m"])),
    ),
    Metric(
        name="tip_error_end_mm",
        heading="tip error at the end [mm]",
        matters=0.1,
        matters_source=REPEATABILITY,
        meaning="distance of the tip from its command at the end",
        compute=lambda trace: 1e3 * float(trace["tip_error_m"][-1]),
    ),
    Metric(
        name="rcm_error_rms_mm",
        heading="RCM error, RMS [mm]",
        matters=0.1,
        matters_source=REPEATABILITY,
        meaning="RMS distance of the trocar point from the shaft axis",
        compute=lambda trace: 1e3 * rms(trace["rcm_error_m"]),
    ),
    Metric(
        name="rcm_error_max_mm",
        heading="RCM error, largest [mm]",
        matters=0.1,
        matters_source=REPEATABILITY,
        meaning="largest distance of the trocar point from the shaft axis",
        compute=lambda trace: 1e3 * float(np.max(trace["rcm_error_m"])),
    ),
    Metric(
        name="convergence_time_s",
        heading="time to converge [s]",
        matters=0.1,
        matters_source=CHOICE,
        meaning="time from which the tip stays within 1 mm and the shaft within 5 mm",
        compute=convergence_time_s,
    ),
)
