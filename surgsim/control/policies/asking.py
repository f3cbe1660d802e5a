"""Asking a policy once in a while, and holding its action in between.

The action and the ticks for which it still holds are in the memory of the part that asks: a tick in which the
last action holds does not enter Python.
"""

import math
from collections.abc import Callable

import numpy as np

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.control.failure import ControlFailure
from surgsim.control.inside import HEAD_SIZE
from surgsim.control.policies.observation import observe
from surgsim.control.policies.registry import Policy
from surgsim.errors import Outcome, SurgsimError
from surgsim.tick.fields import Fields
from surgsim.tick.python_part import enter
from surgsim.tick.status import GOES_ON

DECIMATION, ENTRIES, LIMIT = HEAD_SIZE, HEAD_SIZE + 1, HEAD_SIZE + 2
"""Gains after the head: ticks for which an action holds, its k entries, and the bound of each (k,)."""
LEFT, ACTION = 0, 1
"""Memory: further ticks for which the action holds, and the action (k,)."""


class Asker:
    """Asks a policy, from within a kernel.

    Args:
        name: What errors call the policy.
        policy: The policy.
        entries: Of an action.
    """

    def __init__(self, name: str, policy: Policy, entries: int) -> None:
        self._name, self._policy, self._entries = name, policy, entries

    def join(self, seen: Fields, memory: Array) -> Callable[[], None]:
        """What the kernel enters to have the action in its memory written anew."""
        first, action = seen["first"], memory[ACTION : ACTION + self._entries]

        def ask() -> None:
            if first[0]:
                self._reset()
            action[:] = self._wanted(seen)

        return ask

    def _reset(self) -> None:
        """Tell the policy that a run begins, if it wants to know."""
        reset = getattr(self._policy, "reset", None)
        if callable(reset):
            reset()

    def _wanted(self, seen: Fields) -> Array:
        """What the policy wants to do (k,).

        Raises:
            ControlFailure: If it is not finite.
            SurgsimError: If it does not have the right shape.
        """
        action: Array = np.asarray(self._policy(observe(seen)), dtype=float)
        if action.shape != (self._entries,):
            raise SurgsimError(
                f"policy '{self._name}' gave an action of shape {action.shape}, not ({self._entries},)"
            )
        if not all(map(math.isfinite, action.tolist())):  # a third of the time of np.isfinite
            raise ControlFailure(
                Outcome.DIVERGED, f"policy '{self._name}' gave {action}, which is not finite"
            )
        return action


def asking_gains(decimation: int, limit: Array) -> Array:
    """Gains of a kernel that asks, the head not filled in: for `DECIMATION` and the following."""
    return np.concatenate((np.zeros(HEAD_SIZE), (decimation, limit.size), limit))


@compiled
def ask(gains: Array, memory: Array) -> int:
    """Have the policy's action in `memory`: ask for it where the last one holds no longer.

    An action is cut at its limit. Memory is all zeros before the first tick.
    """
    if memory[LEFT] > 0.0:
        memory[LEFT] -= 1.0
        return GOES_ON
    status: int = enter(gains)
    if status != GOES_ON:
        return status
    memory[LEFT] = gains[DECIMATION] - 1.0
    for i in range(int(gains[ENTRIES])):
        limit = gains[LIMIT + i]
        memory[ACTION + i] = min(max(memory[ACTION + i], -limit), limit)
    return GOES_ON
