"""One reaching movement: minimum jerk, duration by Fitts' law, scatter growing with speed."""

import math
from typing import ClassVar

import numpy as np
from pydantic import NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.tick.algebra import norm
from surgsim.tick.arrays import Record

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


class ReachLaw(Record):
    """Numbers of reaching, as in `ReachConfig`."""

    fitts_a_s: float
    fitts_b_s: float
    shortest_s: float
    speed_limit_m_per_s: float
    scatter_s: float
    scatter_floor_m: float


class Reach(Record):
    """A minimum-jerk movement.

    Attributes:
        start_s: When it begins [s].
        duration_s: How long it lasts [s].
        origin: p0 (3,) [m].
        change: p1 - p0 (3,) [m].
    """

    SHAPES: ClassVar[dict[str, str]] = {"origin": "3", "change": "3"}
    start_s: float
    duration_s: float
    origin: Array
    change: Array


@compiled
def movement_time(law: ReachLaw, distance_m: float, width_m: float) -> float:
    """Duration of a movement over `distance_m` to a target of width `width_m` [s]."""
    fitts = law.fitts_a_s + law.fitts_b_s * math.log2(max(2.0 * distance_m / width_m, 1.0))
    return max(fitts, law.shortest_s, _PEAK * distance_m / law.speed_limit_m_per_s)


@compiled
def scatter(law: ReachLaw, distance_m: float, duration_s: float) -> float:
    """Standard deviation of the end point per axis [m]."""
    return law.scatter_s * distance_m / duration_s + law.scatter_floor_m


@compiled
def reach_at(reach: Reach, t_s: float, position: Array, velocity: Array) -> None:
    """Position (3,) [m] and velocity (3,) [m/s] at `t_s`.

    p(t) = p0 + (p1 - p0) (10 u^3 - 15 u^4 + 6 u^5), u = (t - start) / duration in [0, 1].

    Source:
        Flash, Hogan, J. Neurosci. 5(7), 1985.
    """
    u = min(max((t_s - reach.start_s) / reach.duration_s, 0.0), 1.0)
    s = u * u * u * (10.0 + u * (-15.0 + 6.0 * u))
    ds = 30.0 * u * u * ((1.0 - u) * (1.0 - u)) / reach.duration_s
    for i in range(3):
        position[i], velocity[i] = reach.origin[i] + s * reach.change[i], ds * reach.change[i]


@compiled
def aim(law: ReachLaw, reach: Reach, target: Array, width_m: float, start_s: float, noise: Array) -> None:
    """Plan a movement from the origin that `reach` has to `target` (3,) [m], scattered by `noise`, normal."""
    way = np.empty(3)
    for i in range(3):
        way[i] = target[i] - reach.origin[i]
    distance = norm(way)
    duration = movement_time(law, distance, width_m)
    spread = scatter(law, distance, duration)
    reach.start_s, reach.duration_s = start_s, duration
    for i in range(3):
        reach.change[i] = way[i] + spread * noise[i]
