"""What every task promises."""

from typing import Any

import numpy as np

from surgsim.array import Array
from surgsim.columns import width
from surgsim.contract.check import Check, require
from surgsim.contract.problems import DT
from surgsim.tasks.base import Feedback

_START = np.array([0.1, 0.5, 0.0])
_TICKS = 300


def _task(config: Any) -> Any:
    return config().build(_START, DT, np.random.SeedSequence(0))


def _by_time(task: Any, times: Array, order: Array) -> Array:
    """Commands (times, 3, 3) asked for in `order`."""
    commands = {t: task.command(float(t)) for t in order}
    return np.array([[commands[t].p_WTd, commands[t].v_WTd, commands[t].a_WTd] for t in times])


def _in_turn(task: Any) -> Array:
    """Commands and columns (ticks, 9 + columns) from a reset on, with a tip that stays where it began."""
    feedback = Feedback(p_WT=_START, v_WT=np.zeros(3), R_WT=np.eye(3), w_WT=np.zeros(3), f_T=np.zeros(3))
    task.reset()
    rows = []
    for k in range(_TICKS):
        command = task.command(DT * k, feedback)
        rows.append(np.concatenate((command.p_WTd, command.v_WTd, command.a_WTd, task.values())))
    return np.array(rows)


def commands(config: Any) -> None:
    """Finite commands that move the tip, the same after a reset, in any order of time unless it reacts."""
    task = _task(config)
    times = np.linspace(0.0, task.duration_s, 23)
    if not task.reacts:
        forward = _by_time(task, times, times)
        require(forward.shape == (23, 3, 3), f"23 commands have the shape {forward.shape}, not (23, 3, 3)")
        require(np.isfinite(forward).all(), "a command is not finite")
        again = _by_time(task, times, times[::-1])
        require(np.array_equal(again, forward), "commands differ if they are asked for in another order")
        require(np.ptp(forward[:, 0], axis=0).max() > 1e-4, "the tip is never asked to move")
    first = _in_turn(task)
    asked = 9 + width(task.columns)
    require(first.shape == (_TICKS, asked), f"rows have {first.shape[1]} values, the columns ask for {asked}")
    require(np.isfinite(first[:, :9]).all(), "a command is not finite")
    require(
        np.array_equal(_in_turn(task), first, equal_nan=True), "after a reset the task says something else"
    )


def places(config: Any) -> None:
    """The places that the tip must reach are named, finite, and there is one at least."""
    reach = _task(config).reach()
    require(len(reach) > 0, "no place is named that the tip must reach")
    for name, point in reach:
        require(isinstance(name, str) and name, f"a place has no name: {name!r}")
        require(np.shape(point) == (3,) and np.isfinite(point).all(), f"{name} is no point: {point}")


def says_whether_done(config: Any) -> None:
    """The config has what a scenario asks of it: `start_m`, and `success` of a run."""
    part = config()
    require(hasattr(part, "start_m"), "the config has no start_m: where the path begins, or None")
    require(callable(getattr(part, "success", None)), "the config has no method success(run)")


CHECKS = (
    Check(name="commands are finite, move the tip, and are the same again", run=commands),
    Check(name="names the places that the tip must reach", run=places),
    Check(name="says where it begins and whether it was done", run=says_whether_done),
)
