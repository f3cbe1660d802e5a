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
        roll: Wanted turn of the grip about its axis, over the fastest, -1 to 1; above 0 to the right.
        clutch: Whether the pedal is pressed that lets the handle go without the instrument.
        end: Whether the operator is done.
    """

    velocity: Velocity = (0.0, 0.0, 0.0)
    jaw: float = 0.0
    roll: float = 0.0
    clutch: bool = False
    end: bool = False


Source = Callable[[float], Intent]
"""The input at a time [s]; asked once a tick, in order of time."""
