"""A task's command as the record of a tick and as an object."""

import math

from surgsim.tasks.base import EnergyBudget, TipCommand
from surgsim.tick.arrays import Command, Seen
from surgsim.tick.fields import Fields


def fill_command_of(out: Command | Seen, command: TipCommand) -> None:
    """Write a command into a `Command` or `Seen`, a shift of the remote centre left out."""
    out["p_WTd"], out["v_WTd"], out["a_WTd"] = command.p_WTd, command.v_WTd, command.a_WTd
    out["roll_rate"], out["jaw"] = command.roll_rate, command.jaw
    budget = command.budget
    out["budget_j"] = math.inf if budget is None else budget.most_j
    out["budget_f_T"] = 0.0 if budget is None else budget.f_T


def fill_command(out: Command, command: TipCommand) -> None:
    """Write a command into a `Command`."""
    fill_command_of(out, command)
    out["rcm_shift"] = 0.0 if command.rcm_shift is None else command.rcm_shift
    out["rcm_shift_rate"] = 0.0 if command.rcm_shift_rate is None else command.rcm_shift_rate


def command_of(told: Command | Seen | Fields) -> TipCommand:
    """A copy of the command in a `Command` or `Seen`; a shift of the remote centre is left out."""
    budget, most_j = None, told["budget_j"].item()
    if math.isfinite(most_j):
        budget = EnergyBudget(most_j=most_j, f_T=told["budget_f_T"].copy())
    return TipCommand(
        p_WTd=told["p_WTd"].copy(),
        v_WTd=told["v_WTd"].copy(),
        a_WTd=told["a_WTd"].copy(),
        roll_rate=told["roll_rate"].item(),
        jaw=told["jaw"].item(),
        budget=budget,
    )
