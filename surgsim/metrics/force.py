"""How hard the shaft pressed on the abdominal wall, and the tip on what it touched.

f is the force between them at every tick, `trocar_force` and `tip_force` of the trace. None where nothing
measures it.
"""

import numpy as np

from surgsim.array import Array
from surgsim.metrics.accuracy import rms
from surgsim.metrics.metric import CHOICE, FORCE_RESOLUTION, Metric
from surgsim.trace.trace import Trace


def force_size(trace: Trace, block: str) -> Array:
    """|f| at every tick (rows,) [N]; no rows in a trace without that force."""
    return np.linalg.norm(trace.block(block), axis=1) if block in trace else np.zeros(0)


def trocar_force_rms_n(trace: Trace) -> float:
    """RMS of |f| on the wall [N]."""
    force = force_size(trace, "trocar_force")
    return rms(force) if force.size else float("nan")


def trocar_impulse_n_s(trace: Trace) -> float:
    """Integral of |f| on the wall over the run [N s], by the trapezoidal rule."""
    force = force_size(trace, "trocar_force")
    return float(np.trapezoid(force, trace["t_s"])) if force.size else float("nan")


def largest(trace: Trace, block: str) -> float:
    """Largest |f| [N]; NaN without such a force."""
    force = force_size(trace, block)
    return float(np.max(force)) if force.size else float("nan")


METRICS = (
    Metric(
        name="trocar_force_rms_n",
        heading="force on the wall, RMS [N]",
        matters=0.05,
        matters_source=FORCE_RESOLUTION,
        meaning="RMS force of the shaft on the abdominal wall",
        compute=trocar_force_rms_n,
    ),
    Metric(
        name="trocar_force_max_n",
        heading="force on the wall, largest [N]",
        matters=0.05,
        matters_source=FORCE_RESOLUTION,
        meaning="largest force of the shaft on the abdominal wall",
        compute=lambda trace: largest(trace, "trocar_force"),
    ),
    Metric(
        name="trocar_impulse_n_s",
        heading="force on the wall, integral over time [N s]",
        matters=0.5,
        matters_source=CHOICE,
        meaning="integral over time of the size of the force on the abdominal wall",
        compute=trocar_impulse_n_s,
    ),
    Metric(
        name="tip_force_max_n",
        heading="force on the tip, largest [N]",
        matters=0.05,
        matters_source=FORCE_RESOLUTION,
        meaning="largest force of the surroundings on the tip",
        compute=lambda trace: largest(trace, "tip_force"),
    ),
)
