"""Asking a policy once in a while, and holding its action in between."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from surgsim.control.failure import ControlFailure
from surgsim.control.policies.observation import Seen, observe
from surgsim.control.policies.registry import Policy
from surgsim.errors import Outcome, SurgsimError

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Held:
    """An action and the number of further ticks for which it holds."""

    action: Array
    ticks: int


class Asker:
    """Asks a policy once in `decimation` ticks.

    Args:
        name: What errors call the policy.
        policy: The policy.
        limit: Bound of each entry of an action, at which it is cut (n,).
        decimation: Ticks for which an action holds.
    """

    def __init__(self, name: str, policy: Policy, limit: Array, decimation: int) -> None:
        self._name = name
        self._policy = policy
        self._limit = limit
        self._decimation = decimation

    def start(self) -> None:
        """Tell the policy that a run begins, if it wants to know."""
        reset = getattr(self._policy, "reset", None)
        if callable(reset):
            reset()

    def ask(self, seen: Seen, held: Held | None) -> Held:
        """The action for this tick; `held` is that of the tick before, None at the first.

        Raises:
            ControlFailure: If the policy's action is not finite.
            SurgsimError: If it does not have the right shape.
        """
        if held is not None and held.ticks > 0:
            return Held(action=held.action, ticks=held.ticks - 1)
        action = np.array(self._policy(observe(seen)), dtype=float)
        if action.shape != self._limit.shape:
            raise SurgsimError(
                f"policy '{self._name}' gave an action of shape {action.shape}, not {self._limit.shape}"
            )
        if not np.isfinite(action).all():
            raise ControlFailure(
                Outcome.DIVERGED, f"policy '{self._name}' gave {action}, which is not finite"
            )
        action = np.minimum(np.maximum(action, -self._limit), self._limit)
        return Held(action=action, ticks=self._decimation - 1)
