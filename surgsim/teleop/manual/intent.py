"""What a person at keyboard or gamepad wants at a moment."""

from collections.abc import Callable
from dataclasses import dataclass

Velocity = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True, slots=True)
class Intent:
    """One moment's input.

    Attributes:
        velocity: Wanted velocity of the tip, world frame [m/s].
        jaw: Wanted closing of the jaws, 0 open to 1 closed.
        end: Whether the operator is done.
    """

    velocity: Velocity = (0.0, 0.0, 0.0)
    jaw: float = 0.0
    end: bool = False


Source = Callable[[float], Intent]
"""The input at a time [s]; asked once a tick, in order of time."""
