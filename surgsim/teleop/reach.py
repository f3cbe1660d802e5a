"""One reaching movement: minimum jerk, duration by Fitts' law, scatter growing with speed."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import NonNegativeFloat, PositiveFloat

from surgsim.catalog import PartConfig

Array = NDArray[np.float64]
_PEAK = 1.875  # peak over mean speed of a minimum-jerk movement


class ReachConfig(PartConfig):
    """Speed and accuracy of reaching, in hand coordinates.

    Duration: MT = a + b log2(2 D / W), Fitts, J. Exp. Psychol. 47(6), 1954, but at least `shortest_s` and
    so long that the peak speed stays below `speed_limit_m_per_s`. End points scatter with
    sigma = c D / MT + sigma_0 per axis (Schmidt et al., Psychol. Rev. 86(5), 1979). a, b, c are of the order
    of the published ones (b of 0.1 to 0.2 s/bit, about 8 mm at 1 m/s); the rest are assumptions.
    """

    fitts_a_s: NonNegativeFloat = 0.1
    fitts_b_s: PositiveFloat = 0.15
    shortest_s: PositiveFloat = 0.2
    speed_limit_m_per_s: PositiveFloat = 0.15
    scatter_s: NonNegativeFloat = 0.008
    scatter_floor_m: NonNegativeFloat = 1e-4


def movement_time(distance_m: float, width_m: float, config: ReachConfig) -> float:
    """Duration of a movement over `distance_m` to a target of width `width_m` [s]."""
    fitts = config.fitts_a_s + config.fitts_b_s * math.log2(max(2.0 * distance_m / width_m, 1.0))
    return max(fitts, config.shortest_s, _PEAK * distance_m / config.speed_limit_m_per_s)


def scatter(distance_m: float, duration_s: float, config: ReachConfig) -> float:
    """Standard deviation of the end point per axis [m]."""
    return config.scatter_s * distance_m / duration_s + config.scatter_floor_m


@dataclass(frozen=True, kw_only=True, slots=True)
class Reach:
    """Minimum-jerk movement (Flash, Hogan, J. Neurosci. 5(7), 1985).

    p(t) = p0 + (p1 - p0) (10 u^3 - 15 u^4 + 6 u^5), u = (t - start) / duration in [0, 1].

    Attributes:
        start_s: When it begins.
        duration_s: How long it lasts.
        origin: p0 (3,) [m].
        change: p1 - p0 (3,) [m].
    """

    start_s: float
    duration_s: float
    origin: Array
    change: Array

    @property
    def end_s(self) -> float:
        """When it ends."""
        return self.start_s + self.duration_s

    def at(self, t_s: float) -> tuple[Array, Array]:
        """Position (3,) [m] and velocity (3,) [m/s]."""
        u = min(max((t_s - self.start_s) / self.duration_s, 0.0), 1.0)
        s = u * u * u * (10.0 + u * (-15.0 + 6.0 * u))
        ds = 30.0 * u * u * (1.0 - u) ** 2 / self.duration_s
        return self.origin + s * self.change, ds * self.change


def aim(
    origin: Array,
    target: Array,
    width_m: float,
    start_s: float,
    config: ReachConfig,
    rng: np.random.Generator,
) -> Reach:
    """Plan a movement from `origin` to `target` (3,) [m], with its scatter drawn from `rng`."""
    distance = float(np.linalg.norm(target - origin))
    duration = movement_time(distance, width_m, config)
    error = scatter(distance, duration, config) * rng.standard_normal(3)
    return Reach(start_s=start_s, duration_s=duration, origin=origin, change=target - origin + error)
