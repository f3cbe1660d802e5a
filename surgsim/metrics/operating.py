"""How the console was operated: the clutch. Undefined (NaN) for a trace of another task."""

import numpy as np

from surgsim.metrics.metric import CHOICE, Metric, with_block
from surgsim.trace.trace import Trace


def clutchings(trace: Trace) -> float:
    """How often the clutch was opened."""
    closed = trace["clutch_engaged"] == 1.0
    return float(np.count_nonzero(closed[:-1] & ~closed[1:]))


def clutch_open_fraction(trace: Trace) -> float:
    """Share of the ticks in which the clutch was not closed."""
    return float(np.mean(trace["clutch_engaged"] < 1.0))


METRICS = (
    Metric(
        name="clutchings",
        heading="times the clutch was opened",
        meaning="how often the operator opened the clutch to re-index the handle",
        compute=with_block("clutch_engaged", clutchings),
        lower_is_better=None,
    ),
    Metric(
        name="clutch_open_fraction",
        heading="ticks with the clutch not closed, share",
        matters=0.01,
        matters_source=CHOICE,
        meaning="fraction of ticks in which the clutch was open, opening or closing",
        compute=with_block("clutch_engaged", clutch_open_fraction),
        lower_is_better=None,
    ),
)
