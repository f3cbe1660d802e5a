"""Joins a task, a kernel or a Python object, to the arrays of a tick."""

from typing import Any

import numpy as np
from numba.core.dispatcher import Dispatcher

from surgsim.array import Array
from surgsim.compiled import address_of
from surgsim.tasks.base import Feedback, Task
from surgsim.tasks.command import fill_command
from surgsim.tick.arrays import Command, task_signature
from surgsim.tick.python_part import PythonPart, python_kernel


class BoundTask:
    """A task as the loop sees it.

    Args:
        task: The task; one with a compiled `kernel` gives its numbers in `gains` and `memory`.
        command: Where its command goes.

    Attributes:
        kernel: Address of what the loop calls.
        told: What the task is told; to be set by the loop.
        gains: Its numbers.
        memory: Its memory.
    """

    def __init__(self, task: Task, command: Command) -> None:
        self._task, self._command = task, command
        kernel: Any = getattr(task, "kernel", None)
        self.told: Any = None
        self._entered: PythonPart | None = None
        self.memory: Array = getattr(task, "memory", np.zeros(0))
        if isinstance(kernel, Dispatcher):
            self.kernel: int = address_of(kernel, task_signature())
            self.gains: Array = task.gains  # type: ignore[attr-defined]
            self._enter_within(task)
        else:
            self._entered = PythonPart(self._call)
            self.kernel, self.gains = address_of(python_kernel, task_signature()), self._entered.gains

    def _enter_within(self, task: Any) -> None:
        """Let a kernel that has a Python part within it enter that."""
        if hasattr(task, "enter"):
            self._entered = PythonPart(task.act)
            task.enter(self._entered.gains)

    def refill(self, ticks: int) -> None:
        """Let it draw ahead what the next `ticks` ticks need."""
        if hasattr(self._task, "refill"):
            self._task.refill(ticks)

    def raised(self) -> BaseException | None:
        """What a task in Python raised."""
        return None if self._entered is None else self._entered.raised()

    def _call(self) -> None:
        told, t_s, out = self.told, float(self.told.t_s), self._command
        feedback = None
        if self._task.reacts:
            feedback = Feedback(
                p_WT=told.p_WT.copy(),
                v_WT=told.v_WT.copy(),
                R_WT=told.R_WT.copy(),
                w_WT=told.w_WT.copy(),
                f_T=told.f_T.copy(),
            )
        fill_command(out, self._task.command(t_s, feedback))
        values = self._task.values()
        out.values[: values.size] = values
        out.finished = self._task.finished(t_s)
