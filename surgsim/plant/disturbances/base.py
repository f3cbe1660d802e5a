"""What every disturbance has: its config's base and the spread over seeds."""

import copy
import math
from abc import ABC, abstractmethod
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.plant.part import BLOCK_TICKS, PlantPart
from surgsim.spatial import unit

Spread = Annotated[float, Field(ge=0.0, le=1.0)]
"""Half-width of a uniform relative spread: a value x is drawn from x (1 - spread) to x (1 + spread)."""

Direction = Literal["given", "random"]
"""Whether a vector points where it is said to, or keeps its size and points in a drawn direction."""

SENSOR, LATE = 1, 2
"""Ranks in the chain of `sense`: what is known of the port, then noise, then the way to the controller."""
DELAYED, QUANTISED, BIASED = 1, 2, 3
"""Ranks in the chain of `actuate`: missed ticks, then the delay to the drive, its resolution, its bias."""


def spread_factor(rng: np.random.Generator, spread: float, size: int = 1) -> Array:
    """`size` factors drawn uniformly from 1 - spread to 1 + spread."""
    return 1.0 + spread * rng.uniform(-1.0, 1.0, size)


def copied(rng: np.random.Generator) -> np.random.Generator:
    """A generator that draws what `rng` would, which stays as it is.

    For values of each joint: how many there are is known once the model is there, and more than one may be
    built with a part.
    """
    return copy.deepcopy(rng)


def pointed(rng: np.random.Generator, vector: Array, direction: Direction) -> Array:
    """`vector` (3,) as given, or turned to a direction drawn from the sphere."""
    if direction == "given":
        return vector
    return float(np.linalg.norm(vector)) * unit(rng.normal(size=3))


def whole_ticks(name: str, key: str, time_s: float, control_period_s: float) -> int:
    """A time in control periods.

    Args:
        name: The disturbance, for the message.
        key: Of the time.
        time_s: The time [s].
        control_period_s: The control period [s].

    Raises:
        ValueError: If it is no whole multiple.
    """
    ratio = time_s / control_period_s
    if abs(ratio - round(ratio)) > 1e-6 or (time_s > 0.0 and round(ratio) < 1):
        raise ValueError(
            f"{name}: {key} {time_s:g} must be a whole multiple of control_period_s {control_period_s:g}"
        )
    return round(ratio)


@compiled
def drawn_row(tick: int) -> int:
    """Row of what a sensor drew for a tick: that of the start comes first, then those of `BLOCK_TICKS`."""
    return 0 if tick == 0 else (tick - 1) % BLOCK_TICKS + 1


@compiled
def frame_at(t_s: float, rate_hz: float) -> int:
    """Frames that a tracker has begun by `t_s` [s], the first at the start."""
    return math.floor(t_s * rate_hz + 1e-6) + 1


def check_rate(name: str, key: str, rate_hz: float, control_period_s: float) -> None:
    """Refuse a sensor that measures more often than once a control period.

    Args:
        name: The disturbance, for the message.
        key: Of the rate.
        rate_hz: Measurements per second [Hz].
        control_period_s: The control period [s].

    Raises:
        ValueError: If it does.
    """
    if rate_hz * control_period_s > 1.0 + 1e-9:
        raise ValueError(
            f"{name}: {key} {rate_hz:g} must be at most one measurement a control period, "
            f"{1.0 / control_period_s:g} Hz"
        )


class DisturbanceConfig(PartConfig, ABC):
    """Base of a disturbance's config.

    Attributes:
        measures_flange: Whether it is a force-torque sensor at the flange.
    """

    measures_flange: ClassVar[bool] = False

    @abstractmethod
    def build(self, rng: np.random.Generator) -> PlantPart:
        """The disturbance, its values drawn from `rng` if they have a spread."""

    @property
    def begins_s(self) -> float:
        """When it first acts, since the start of the run [s]; one that begins after the end is refused."""
        return 0.0


class Disturbance(PlantPart):
    """A part of the plant that the controller's model does not know of."""
