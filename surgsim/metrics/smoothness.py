"""Spectral arc length: how smooth a movement is."""

import numpy as np

from surgsim.array import Array
from surgsim.metrics.metric import CHOICE, Metric
from surgsim.trace.trace import Trace


def sparc(
    speed: Array,
    sample_rate_hz: float,
    *,
    pad_level: int = 4,
    cut_off_hz: float = 10.0,
    amplitude_threshold: float = 0.05,
) -> float:
    """Spectral arc length of a speed profile (n,); 0 at best, more negative is less smooth.

    The arc length of the normalised Fourier magnitude up to the last frequency, below the cut-off, at
    which it exceeds the threshold. Source: Balasubramanian et al., J. NeuroEng. Rehabil. 12:112, 2015.

    Returns:
        The (negative) arc length, or NaN for a movement that never moves.
    """
    if speed.size < 4 or not np.isfinite(speed).all() or np.max(np.abs(speed)) < 1e-9:
        return float("nan")
    size = 2 ** (int(np.ceil(np.log2(speed.size))) + pad_level)
    magnitude = np.abs(np.fft.rfft(speed, size))
    frequency = np.fft.rfftfreq(size, 1.0 / sample_rate_hz)
    magnitude = magnitude / magnitude.max()
    below = frequency <= cut_off_hz
    frequency, magnitude = frequency[below], magnitude[below]
    above = np.flatnonzero(magnitude >= amplitude_threshold)
    selected = slice(above[0], above[-1] + 1)
    frequency, magnitude = frequency[selected], magnitude[selected]
    if frequency.size < 2:
        return float("nan")
    steps = np.diff(frequency) / (frequency[-1] - frequency[0])
    return float(-np.sum(np.hypot(steps, np.diff(magnitude))))


def tip_sparc(trace: Trace) -> float:
    """Spectral arc length of the tip's speed."""
    if len(trace) < 4:
        return float("nan")
    rate = 1.0 / trace.meta.control_period_s
    speed = np.linalg.norm(np.diff(trace.block("tip"), axis=0), axis=1) * rate
    return sparc(speed, rate)


METRICS = (
    Metric(
        name="sparc",
        heading="spectral arc length of the tip's speed",
        matters=0.1,
        matters_source=CHOICE,
        meaning="spectral arc length of the tip's speed, 0 is smoothest",
        compute=tip_sparc,
        lower_is_better=False,
    ),
)
