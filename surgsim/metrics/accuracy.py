"""How well tip and shaft are where they should be, and where their controller takes them to be.

Errors are the true ones. A control error is what the controller itself sees of its error: its nominal model
at the measured joint positions, against the command and against the port as it knows it. Where the model is
the arm and measurement is exact the two are equal; with a calibration error the control error may be small
and the error not.
"""

import math
from collections.abc import Callable

import numpy as np

from surgsim.array import Array
from surgsim.metrics.metric import CHOICE, REPEATABILITY, STEADY_HAND, Metric, with_block
from surgsim.trace.trace import Trace

CONVERGED_TIP_M = 1e-3
CONVERGED_RCM_M = 5e-3


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def tip_control_error_m(trace: Trace) -> Array:
    """|p_believed - p_WTd| at every tick (rows,) [m]; NaN where the controller was not asked."""
    errors: Array = np.linalg.norm(trace.block("tip_believed") - trace.block("tip_ref"), axis=1)
    return errors


def of_asked(reduce: Callable[[Array], float], errors: Array) -> float:
    """`reduce` of the errors [m] of the ticks in which the controller was asked, in mm; NaN without any.

    It is not asked in the tick in which a limit is found passed.
    """
    known = errors[~np.isnan(errors)]
    return 1e3 * reduce(known) if known.size else math.nan


def largest(values: Array) -> float:
    """Largest value."""
    return float(np.max(values))


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
        matters_source=STEADY_HAND,
        meaning="RMS distance of the true tip from its command at the same tick",
        compute=lambda trace: 1e3 * rms(trace["tip_error_m"]),
    ),
    Metric(
        name="tip_error_max_mm",
        heading="tip error, largest [mm]",
        matters=0.1,
        matters_source=STEADY_HAND,
        meaning="largest distance of the true tip from its command",
        compute=lambda trace: 1e3 * float(np.max(trace["tip_error_m"])),
    ),
    Metric(
        name="tip_error_end_mm",
        heading="tip error at the end [mm]",
        matters=0.1,
        matters_source=STEADY_HAND,
        meaning="distance of the true tip from its command at the end",
        compute=lambda trace: 1e3 * float(trace["tip_error_m"][-1]),
    ),
    Metric(
        name="rcm_error_rms_mm",
        heading="RCM error, RMS [mm]",
        matters=0.1,
        matters_source=REPEATABILITY,
        meaning="RMS distance of the trocar point from the true shaft axis",
        compute=lambda trace: 1e3 * rms(trace["rcm_error_m"]),
    ),
    Metric(
        name="rcm_error_max_mm",
        heading="RCM error, largest [mm]",
        matters=0.1,
        matters_source=REPEATABILITY,
        meaning="largest distance of the trocar point from the true shaft axis",
        compute=lambda trace: 1e3 * float(np.max(trace["rcm_error_m"])),
    ),
    Metric(
        name="tip_control_error_rms_mm",
        heading="tip error as the controller sees it, RMS [mm]",
        matters=0.1,
        matters_source=STEADY_HAND,
        meaning="RMS distance of the tip from its command, by nominal model and measured joints",
        compute=with_block("tip_believed", lambda trace: of_asked(rms, tip_control_error_m(trace))),
    ),
    Metric(
        name="tip_control_error_max_mm",
        heading="tip error as the controller sees it, largest [mm]",
        matters=0.1,
        matters_source=STEADY_HAND,
        meaning="largest distance of the tip from its command, by nominal model and measured joints",
        compute=with_block("tip_believed", lambda trace: of_asked(largest, tip_control_error_m(trace))),
    ),
    Metric(
        name="rcm_control_error_rms_mm",
        heading="RCM error as the controller sees it, RMS [mm]",
        matters=0.1,
        matters_source=REPEATABILITY,
        meaning="RMS distance of the shaft from the port that the controller knows, by nominal model and "
        "measured joints",
        compute=with_block("rcm_error_believed", lambda trace: of_asked(rms, trace["rcm_error_believed_m"])),
    ),
    Metric(
        name="rcm_control_error_max_mm",
        heading="RCM error as the controller sees it, largest [mm]",
        matters=0.1,
        matters_source=REPEATABILITY,
        meaning="largest distance of the shaft from the port that the controller knows, by nominal model and "
        "measured joints",
        compute=with_block(
            "rcm_error_believed", lambda trace: of_asked(largest, trace["rcm_error_believed_m"])
        ),
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
