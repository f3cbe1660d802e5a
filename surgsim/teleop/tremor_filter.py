"""A filter that takes tremor off what the handle tells the remote side."""

import math
from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import Field, PositiveFloat, model_validator

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.tick.arrays import Record

MOST_FREQUENCIES = 32
NONE, LOW_PASS, BMFLC = range(3)
_TYPES = {"none": NONE, "low_pass": LOW_PASS, "bmflc": BMFLC}

MOST_GAIN = 0.5
"""Largest mu n of the combiner: an update takes 2 mu n of an error away, here all of it."""


class TremorFilterConfig(PartConfig):
    """Filter of the tip position that the handle stands for; its velocity is the difference of positions.

    `low_pass` is a Butterworth filter of second order at `cutoff_hz`. `bmflc` estimates the tremor as a sum
    of sines from `lowest_hz` to `highest_hz` in steps of `step_hz`, and takes it off: it delays less at equal
    attenuation. `adaptation_per_s` is how fast the estimate follows. The numbers are assumptions about the
    tremor's band.
    """

    type: Literal["none", "low_pass", "bmflc"] = "none"
    cutoff_hz: PositiveFloat = 7.0
    lowest_hz: PositiveFloat = 7.0
    highest_hz: PositiveFloat = 13.0
    step_hz: PositiveFloat = 0.5
    adaptation_per_s: float = Field(default=2.0, gt=0.0, le=5.0)

    @property
    def frequencies(self) -> int:
        """How many sines the estimate has."""
        return math.floor((self.highest_hz - self.lowest_hz) / self.step_hz + 1e-9) + 1

    @model_validator(mode="after")
    def _band_has_room(self) -> Self:
        if not 1 <= self.frequencies <= MOST_FREQUENCIES:
            raise ValueError(
                f"lowest_hz {self.lowest_hz:g} to highest_hz {self.highest_hz:g} by {self.step_hz:g} must be "
                f"1 to {MOST_FREQUENCIES} frequencies, not {self.frequencies}"
            )
        return self

    def sampled(self, period_s: float) -> None:
        """Refuse what a control period [s] cannot sample.

        Raises:
            ValueError: If a frequency in use is not below a tenth of the sampling rate, or the estimate of
                the tremor would not settle.
        """
        used = {"low_pass": ("cutoff_hz",), "bmflc": ("lowest_hz", "highest_hz"), "none": ()}[self.type]
        for name in used:
            if getattr(self, name) >= 0.1 / period_s:
                raise ValueError(
                    f"tremor_filter.{name} {getattr(self, name):g} must be below {0.1 / period_s:g}, a tenth "
                    "of the control rate"
                )
        gain = self.adaptation_per_s * period_s * self.frequencies
        if self.type == "bmflc" and gain > MOST_GAIN:
            raise ValueError(
                f"tremor_filter.adaptation_per_s {self.adaptation_per_s:g} is too fast for "
                f"{self.frequencies} frequencies and a control period of {period_s:g} s: it must be at most "
                f"{MOST_GAIN / (period_s * self.frequencies):.3g}, or the estimate does not settle"
            )


class TremorFilterLaw(Record):
    """Numbers of the filter.

    Attributes:
        type: NONE, LOW_PASS or BMFLC.
        period_s: Control period [s].
        b: Gain of the newest input of the low-pass.
        a_1: Of its last output.
        a_2: Of the one before.
        lowest_rad_per_s: Lowest frequency of the sines.
        step_rad_per_s: From one to the next.
        count: How many there are.
        rate: mu, adaptation of their weights in a period.
    """

    type: int
    period_s: float
    b: float
    a_1: float
    a_2: float
    lowest_rad_per_s: float
    step_rad_per_s: float
    count: int
    rate: float


class TremorFilter(Record):
    """State of the filter.

    Attributes:
        begun: Whether it has seen a position.
        origin: The first one (3,) [m].
        inputs: The last two, from the origin (2, 3) [m].
        outputs: The last two (2, 3) [m].
        weights: Of sines and cosines (64, 3) [m].
    """

    SHAPES: ClassVar[dict[str, str]] = {
        "origin": "3",
        "inputs": "2 3",
        "outputs": "2 3",
        "weights": f"{2 * MOST_FREQUENCIES} 3",
    }
    begun: int
    origin: Array
    inputs: Array
    outputs: Array
    weights: Array


def describe_filter(law: TremorFilterLaw, config: TremorFilterConfig, period_s: float) -> None:
    """Fill the numbers for a control period [s]; the low-pass by the bilinear transform."""
    law.type, law.period_s = _TYPES[config.type], period_s
    k = math.tan(math.pi * config.cutoff_hz * period_s)
    law.b = k * k / (1.0 + math.sqrt(2.0) * k + k * k)
    law.a_1 = 2.0 * (1.0 - k * k) / (1.0 + math.sqrt(2.0) * k + k * k)
    law.a_2 = -(1.0 - math.sqrt(2.0) * k + k * k) / (1.0 + math.sqrt(2.0) * k + k * k)
    law.lowest_rad_per_s, law.step_rad_per_s = 2.0 * math.pi * np.array([config.lowest_hz, config.step_hz])
    law.count, law.rate = config.frequencies, config.adaptation_per_s * period_s


@compiled
def _combine(law: TremorFilterLaw, state: TremorFilter, t_s: float, axis: int, x: float) -> float:
    """Take the sum y of the sines off x, with the gain 1 at rest.

        y = sum_i w_i x_i,   w_i += 2 mu (x - y) x_i,   x_i the sines and cosines of the band

    Band-limited multiple Fourier linear combiner: Veluvolu, Ang, Sensors 11(3), 2011, after the weighted one
    of Riviere, Rader, Thakor, IEEE Trans. Biomed. Eng. 45(7), 1998. For a constant x it settles at
    x / (1 - mu n), n the number of frequencies; the factor 1 - mu n is ours.
    """
    estimate, weights = 0.0, state.weights
    for i in range(law.count):
        angle = (law.lowest_rad_per_s + i * law.step_rad_per_s) * t_s
        estimate += weights[2 * i, axis] * math.sin(angle) + weights[2 * i + 1, axis] * math.cos(angle)
    left = x - estimate
    for i in range(law.count):
        angle = (law.lowest_rad_per_s + i * law.step_rad_per_s) * t_s
        weights[2 * i, axis] += 2.0 * law.rate * left * math.sin(angle)
        weights[2 * i + 1, axis] += 2.0 * law.rate * left * math.cos(angle)
    return (1.0 - law.rate * law.count) * left


@compiled
def steady(law: TremorFilterLaw, state: TremorFilter, t_s: float, position: Array, velocity: Array) -> None:
    """Filter `position` (3,) [m] in place, and put its change over the period in `velocity` (3,) [m/s]."""
    if law.type == NONE:
        return
    if not state.begun:
        state.begun = 1
        for i in range(3):
            state.origin[i] = position[i]
    inputs, outputs = state.inputs, state.outputs
    for i in range(3):
        x = position[i] - state.origin[i]
        if law.type == LOW_PASS:
            y = law.b * (x + 2.0 * inputs[0, i] + inputs[1, i])
            y += law.a_1 * outputs[0, i] + law.a_2 * outputs[1, i]
        else:
            y = _combine(law, state, t_s, i, x)
        velocity[i] = (y - outputs[0, i]) / law.period_s
        inputs[1, i], inputs[0, i] = inputs[0, i], x
        outputs[1, i], outputs[0, i] = outputs[0, i], y
        position[i] = state.origin[i] + y
