"""Whoever holds the handle, and what is done with it in a period."""

from dataclasses import dataclass, field
from typing import ClassVar, Protocol

import numpy as np

from surgsim.array import Array
from surgsim.teleop.console import ConsoleState
from surgsim.tick.arrays import Record


@dataclass(frozen=True, kw_only=True, slots=True)
class HandCommand:
    """What a hand in Python does in one period.

    Attributes:
        wrench: Force and torque on the handle in O (6,) [N, N m].
        jaw: Closing of the pinch grip, 0 to 1.
        goal: Index of the goal; the number of goals once done.
        done: No goal is left.
        missed: Goals given up so far.
        intended: Where the hand is meant to be, in O (3,) [m], without tremor; NaN if it does not say.
        clutch: Whether the pedal is pressed that lets the handle go without the instrument.
    """

    wrench: Array
    jaw: float
    goal: int
    done: bool
    missed: int
    intended: Array = field(default_factory=lambda: np.full(3, np.nan))
    clutch: bool = False


class Hand(Protocol):
    """Whoever holds the handle in the simulated operator's place: a person, or an outside class."""

    def step(self, t_s: float, seen_tip: Array, handle: ConsoleState) -> HandCommand:
        """What the hand does in the period from `t_s`.

        Args:
            t_s: Time [s].
            seen_tip: Remote tip as the screen shows it, already delayed (3,) [m].
            handle: What the console measures, a copy of its `ConsoleState`.
        """
        ...


class HandAction(Record):
    """What the hand does in one period; as `HandCommand`."""

    SHAPES: ClassVar[dict[str, str]] = {"wrench": "6", "intended": "3"}
    wrench: Array
    jaw: float
    goal: int
    done: int
    missed: int
    intended: Array
    clutch: int


def fill_action(action: HandAction, command: HandCommand) -> None:
    """Write what a hand in Python does."""
    action.wrench[:], action.jaw, action.goal = command.wrench, command.jaw, command.goal
    action.done, action.missed, action.intended[:] = command.done, command.missed, command.intended
    action.clutch = command.clutch
