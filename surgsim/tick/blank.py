"""New records of a tick."""

import math

from surgsim.tick.arrays import Command, Feedback, new


def new_command() -> Command:
    """A command of no motion at the origin, without an energy budget."""
    command = new(Command, 0)
    command.budget_j = math.inf
    return command


def new_feedback() -> Feedback:
    """Feedback of nothing measured."""
    return new(Feedback, 0)
