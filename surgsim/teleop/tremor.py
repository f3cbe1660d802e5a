"""Physiological tremor: seeded narrow-band noise."""

import math
from typing import Annotated

from pydantic import Field, NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled


class TremorConfig(PartConfig):
    """Tremor of the hand, per axis: RMS amplitude, centre and width of its band.

    8 to 12 Hz: Lakie et al., J. Physiol. 593(19), 2015 (peak between 6 and 12 Hz). 0.07 mm RMS is an
    assumption within what is measured at hand-held instruments (0.02 to 0.25 mm, PMC3032442).
    """

    rms_m: NonNegativeFloat = 7e-5
    centre_hz: PositiveFloat = 10.0
    width_hz: Annotated[float, Field(ge=0.01)] = 2.0


def resonance(config: TremorConfig, period_s: float) -> tuple[float, float, float]:
    """Gains (a_1, a_2, g) of `shake` for a period [s]; g makes the stationary standard deviation rms_m.

    a_1 = 2 r cos(theta), a_2 = -r^2, r = exp(-pi width T), theta = 2 pi centre T.
    """
    r = math.exp(-math.pi * config.width_hz * period_s)
    a1, a2 = 2.0 * r * math.cos(2.0 * math.pi * config.centre_hz * period_s), -r * r
    variance = (1.0 - a2) / ((1.0 + a2) * ((1.0 - a2) ** 2 - a1 * a1))
    return a1, a2, config.rms_m / math.sqrt(variance)


@compiled
def shake(a1: float, a2: float, noise: Array, last: Array, before: Array) -> None:
    """Next displacement, in `last`, and the one before it (3,) [m].

    x_k = a_1 x_{k-1} + a_2 x_{k-2} + g w_k with the noise g w_k.
    """
    for i in range(last.size):
        new = a1 * last[i] + a2 * before[i] + noise[i]
        before[i], last[i] = last[i], new
