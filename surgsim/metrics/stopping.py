"""What the arm did once it was stopped: from the row of the outcome to the end of the recording."""

import numpy as np

from surgsim.metrics.force import largest
from surgsim.metrics.metric import FORCE_RESOLUTION, REPEATABILITY, Metric
from surgsim.trace.trace import Trace


def stop_distance_mm(trace: Trace) -> float:
    """Largest distance of the tip from where it was at the outcome [mm]; NaN if no stop was recorded."""
    tip = trace.stop().block("tip")
    return 1e3 * float(np.linalg.norm(tip - tip[0], axis=1).max()) if len(tip) else float("nan")


METRICS = (
    Metric(
        name="stop_distance_mm",
        heading="distance until stopped [mm]",
        matters=0.1,
        matters_source=REPEATABILITY,
        meaning="how far the tip went from where it was when the run was stopped",
        compute=stop_distance_mm,
        whole=True,
    ),
    Metric(
        name="stop_trocar_force_max_n",
        heading="force on the wall while stopping, largest [N]",
        matters=0.05,
        matters_source=FORCE_RESOLUTION,
        meaning="largest force on the abdominal wall from the stop on",
        compute=lambda trace: largest(trace.stop(), "trocar_force"),
        whole=True,
    ),
    Metric(
        name="stop_tip_force_max_n",
        heading="force on the tip while stopping, largest [N]",
        matters=0.05,
        matters_source=FORCE_RESOLUTION,
        meaning="largest force on the tip from the stop on",
        compute=lambda trace: largest(trace.stop(), "tip_force"),
        whole=True,
    ),
)
