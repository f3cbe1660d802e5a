"""What a teleoperating person is to do: goals in a scenario, or those of a peg board."""

import math

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.models.config import Vec3
from surgsim.models.peg_board import PegBoardLayout, transfer_goals
from surgsim.tasks.success import RunColumns, Success
from surgsim.teleop.goals import Goal
from surgsim.teleop.judgement import faults, stuck

_STEP_M = 0.005
_ABOVE_M = 0.001
RING_ON_TARGET = 2.0
"""Value of a column `ring_state_{1..n}` while the ring rests on its target peg."""


class GoalConfig(PartConfig):
    """One step of the operator's program.

    Attributes:
        position_m: Where the tip shall be, world frame [m]; may lie beyond a wall.
        tolerance_m: How near is near enough; half the target width of Fitts' law [m].
        dwell_s: How long the tip is to be seen there, or a push to last [s].
        jaw: How far the jaws close during this goal, from 0 (open) to 1.
        push: Go there once, without correcting by sight, and stay for `dwell_s`.
        timeout_s: After this the operator gives up and takes the next goal; null: never [s].
        roll_deg: Turn of the grip from the start, which `roll` passes on to the instrument [deg].
    """

    position_m: Vec3
    tolerance_m: PositiveFloat = 0.002
    dwell_s: NonNegativeFloat = 0.2
    jaw: float = Field(default=0.0, ge=0.0, le=1.0)
    push: bool = False
    timeout_s: PositiveFloat | None = None
    roll_deg: float = Field(default=0.0, ge=-120.0, le=120.0)

    def goal(self) -> Goal:
        """The operator's goal."""
        return Goal(
            position=self.position_m,
            tolerance_m=self.tolerance_m,
            dwell_s=self.dwell_s,
            jaw=self.jaw,
            push=self.push,
            timeout_s=math.inf if self.timeout_s is None else self.timeout_s,
            roll=math.radians(self.roll_deg),
        )


def board_goals(layout: PegBoardLayout, timeout_s: float) -> tuple[Goal, ...]:
    """The goals that bring every ring of a board to its target; each is given up after `timeout_s` [s].

    All are 1 mm higher than `transfer_goals` has them: a hand that is 1 mm off would press on the rim.
    """
    up = _ABOVE_M * layout.R_WB[:, 2]
    return tuple(
        Goal(
            position=_triple(step.position + up),
            tolerance_m=step.tolerance_m,
            dwell_s=step.dwell_s,
            jaw=step.jaw,
            timeout_s=timeout_s,
        )
        for step in transfer_goals(layout)
    )


def _triple(p: Array) -> tuple[float, float, float]:
    return float(p[0]), float(p[1]), float(p[2])


def way_points(start: Array, goals: tuple[Goal, ...]) -> list[tuple[str, Array]]:
    """Straight ways between the goals that are not pushes, in steps of 5 mm, each point with its name."""
    points, here = [("the start", np.array(start))], np.array(start)
    for number, goal in enumerate(goals, 1):
        if goal.push:
            continue
        way = np.array(goal.position) - here
        count = max(math.ceil(float(np.linalg.norm(way)) / _STEP_M), 1)
        points += [
            (f"on the way to goal {number} the point", here + way * i / count) for i in range(1, count + 1)
        ]
        here = here + way
    return points


def rings_success(run: RunColumns) -> Success:
    """Success of the transfers of a peg board: every ring rests on its target peg at the end."""
    on_target = run.block("ring_state")[-1] == RING_ON_TARGET
    moved, count = int(np.count_nonzero(on_target)), len(on_target)
    why = stuck(run) if moved < count else ""
    reason = f"{moved} of {count} rings are on their pegs" + (f": {why}" if why else "")
    return Success(done=moved == count, reason=reason)


def goals_success(run: RunColumns, goals: tuple[GoalConfig, ...]) -> Success:
    """Success of a program of goals: the operator has reached each of them, and given up none.

    Where one was not reached, the reason names what was stuck.
    """
    count = len(goals)
    if count == 0:
        return Success(done=None, reason="the operator has no goals")
    at, missed = int(run["goal"][-1]), int(run["goals_missed"][-1])
    if run["operator_done"][-1] > 0.0 and at < count:
        return Success(done=None, reason="a person operated, whose goals nobody counts")
    if at < count:
        left = f"the operator was still at goal {at + 1} of {count} when time was up"
        why = stuck(run, np.array(goals[at].position_m))
        left += f", {missed} missed" if missed else ""
        return Success(done=False, reason=left + (f": {why}" if why else ""))
    why = stuck(run) if missed else ""
    reason = f"{count - missed} of {count} goals were reached" + (f": {why}" if why else "")
    return Success(done=missed == 0, reason=reason)


def conducted(found: Success, run: RunColumns) -> Success:
    """`found`, but not done where the run gave out energy that was not stored, or does not end at rest.

    A run without an energy account is judged by its goals alone.
    """
    wrong = faults(run) if found.done and "delivered" in run else []
    return Success(done=False, reason="; ".join([found.reason, *wrong])) if wrong else found
