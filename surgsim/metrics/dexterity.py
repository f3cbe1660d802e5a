"""Manipulability over the run."""

import numpy as np

from surgsim.metrics.metric import CHOICE, Metric

METRICS = (
    Metric(
        name="manipulability_mean",
        heading="manipulability, mean [m³]",
        matters=0.01,
        matters_source=CHOICE,
        meaning="mean of sqrt(det(J J^T)) of the translational tip Jacobian",
        compute=lambda trace: float(np.mean(trace["manipulability"])),
        lower_is_better=False,
    ),
    Metric(
        name="manipulability_min",
        heading="manipulability, smallest [m³]",
        matters=0.01,
        matters_source=CHOICE,
        meaning="smallest manipulability of the run",
        compute=lambda trace: float(np.min(trace["manipulability"])),
        lower_is_better=False,
    ),
)
