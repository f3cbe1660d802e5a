"""Manipulability over the run."""

import numpy as np

from surgsim.metrics.metric import Metric

METRICS = (
    Metric(
        name="manipulability_mean",
        meaning="mean of sqrt(det(J J^T)) of the translational tip Jacobian",
        compute=lambda trace: float(np.mean(trace["manipulability"])),
        lower_is_better=False,
    ),
    Metric(
        name="manipulability_min",
        meaning="smallest manipulability of the run",
        compute=lambda trace: float(np.min(trace["manipulability"])),
        lower_is_better=False,
    ),
)
