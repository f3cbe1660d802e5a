"""How the console was operated: clutch, motion scaling, tremor, roll. Undefined (NaN) for another task."""

import math

import numpy as np

from surgsim.array import Array
from surgsim.metrics.accuracy import rms
from surgsim.metrics.metric import CHOICE, Metric, with_block
from surgsim.metrics.teleoperation import tip_velocity
from surgsim.trace.trace import Trace

TREMOR_HZ = (8.0, 12.0)
"""Band of physiological tremor: Lakie et al., J. Physiol. 593(19), 2015."""
_SHORTEST_S = 1.0


def clutchings(trace: Trace) -> float:
    """How often the clutch was opened."""
    closed = trace["clutch_engaged"] == 1.0
    return float(np.count_nonzero(closed[:-1] & ~closed[1:]))


def clutch_open_fraction(trace: Trace) -> float:
    """Share of the ticks in which the clutch was not closed."""
    return float(np.mean(trace["clutch_engaged"] < 1.0))


def motion_scale(trace: Trace) -> float:
    """Way of the tip for which the handle stood, over the handle's own while the clutch was closed.

    It is s where the motion scaling is constant, and where it changes its mean over the way; a filter that
    keeps motion from the tip lowers it. NaN if the handle did not move.
    """
    issued, handle = (
        np.linalg.norm(trace.block(name), axis=1) for name in ("velocity_issued", "handle_velocity")
    )
    way = float(np.sum(trace["clutch_engaged"] * handle))
    return float(np.sum(issued)) / way if way > 0.0 else math.nan


def tremor_rms(velocity: Array, period_s: float) -> float:
    """RMS of the motion in the band of tremor, from its velocity (rows, 3) [m/s]; NaN for less than a second.

    Each frequency of the velocity under a Hann window, over 2 pi f: a movement's own spectrum is small there.
    """
    rows = len(velocity)
    if rows * period_s < _SHORTEST_S:
        return math.nan
    window = np.hanning(rows)
    frequency = np.fft.rfftfreq(rows, period_s)
    inside = (frequency >= TREMOR_HZ[0]) & (frequency <= TREMOR_HZ[1])
    spectrum = np.fft.rfft(velocity * window[:, None], axis=0)[inside]
    power = 2.0 * np.abs(spectrum / (2.0 * np.pi * frequency[inside, None])) ** 2
    return math.sqrt(float(power.sum()) / (rows * float(np.sum(window**2))))


def tremor_at_tip(trace: Trace) -> float:
    """RMS of the tip's motion in the band of tremor [m]."""
    return tremor_rms(tip_velocity(trace), trace.meta.control_period_s)


def tremor_transmission(trace: Trace) -> float:
    """The same over that of the tip for which the handle stands."""
    handle = tremor_rms(trace.block("velocity_issued"), trace.meta.control_period_s)
    return tremor_at_tip(trace) / handle if handle > 0.0 else math.nan


def roll_error(trace: Trace) -> float:
    """RMS of the instrument's roll less the roll that the grip stood for, as received [rad]; NaN without."""
    if not trace.meta.scenario["task"]["roll"]["use"]:
        return math.nan
    return rms(trace["roll_rad"] - trace["roll_command_rad"])


METRICS = (
    Metric(
        name="roll_error_rms_deg",
        heading="roll error, RMS [deg]",
        matters=0.1,
        matters_source=CHOICE,
        meaning="RMS of the instrument's roll less the roll that the grip stood for, as received",
        compute=with_block("roll_command", lambda trace: math.degrees(roll_error(trace))),
    ),
    Metric(
        name="tremor_tip_rms_mm",
        heading="tremor at the tip, RMS [mm]",
        matters=0.01,
        matters_source=CHOICE,
        meaning="RMS of the tip's motion from 8 to 12 Hz, in a teleoperation",
        compute=with_block("velocity_issued", lambda trace: 1e3 * tremor_at_tip(trace), rows=2),
    ),
    Metric(
        name="tremor_transmission",
        heading="tremor at the tip over that of the handle",
        matters=0.01,
        matters_source=CHOICE,
        meaning="tremor at the tip over that of the motion which the handle stands for",
        compute=with_block("velocity_issued", tremor_transmission, rows=2),
    ),
    Metric(
        name="motion_scale_mean",
        heading="motion scaling, mean over the way",
        meaning="way of the tip for which the handle stood, over the handle's with the clutch closed",
        compute=with_block("velocity_issued", motion_scale),
        lower_is_better=None,
    ),
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
