"""A path in steps of equal time, as schemes on velocity level step it, and what is measured of its steps."""

import numpy as np

from surgsim.array import Array
from surgsim.tasks.base import Feedback, Task, TimedTask, TipCommand
from surgsim.trace.trace import Trace


class SteppedTask(TimedTask):
    """A task whose velocity is the step to the next sample over the period.

    The mean velocity of a step, where the task itself gives the velocity at its beginning. With the latter
    the tip would run along the tangents and off a curved path by about half a step.

    Args:
        task: The task.
        period_s: Time of a step [s].
    """

    def __init__(self, task: Task, period_s: float) -> None:
        self._task, self._period = task, period_s

    @property
    def duration_s(self) -> float:
        """Length of the whole task [s]."""
        return self._task.duration_s

    def command(self, t_s: float, feedback: Feedback | None = None) -> TipCommand:
        """Desired position at `t_s` [s] and (r(k+1) - r(k)) / T."""
        here = self._task.command(t_s).p_WTd
        there = self._task.command(t_s + self._period).p_WTd
        return TipCommand(p_WTd=here, v_WTd=(there - here) / self._period, a_WTd=np.zeros(3))


def tip_errors(trace: Trace) -> tuple[Array, Array]:
    """Matched errors |p(k) - r(k)| and lagged ones |p(k-1) - r(k)| for k = 1..N [m].

    Position and desired position of the same step; the new desired position against the position before it.
    """
    tip, wanted = trace.block("tip"), trace.block("tip_ref")[1:]
    matched, lagged = (np.linalg.norm(p - wanted, axis=1) for p in (tip[1:], tip[:-1]))
    return np.asarray(matched), np.asarray(lagged)


def acceleration_ratio(trace: Trace) -> float:
    """Largest change of joint velocity in one step, from rest on, over what the acceleration limit allows."""
    steps = np.diff(trace.block("v"), axis=0) / trace.meta.control_period_s
    return float(np.max(np.abs(steps) / np.array(trace.meta.limits["acceleration"])))
