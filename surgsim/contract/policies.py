"""What every policy promises."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from surgsim.contract.check import Check, require
from surgsim.contract.problems import velocity_problem
from surgsim.control.policies.observation import observe

Array = NDArray[np.float64]
_SHAPES = ((3,), (7,))


def _actions(policy: Any) -> list[Array]:
    """Actions on ten observations from a reset on."""
    reset = getattr(policy, "reset", None)
    if callable(reset):
        reset()
    return [np.array(policy(observe(velocity_problem(seed))), dtype=float) for seed in range(10)]


def acts(policy: Any) -> None:
    """Finite actions of three entries (tip) or seven (joints), the same again after a reset."""
    first = _actions(policy)
    for action in first:
        require(action.shape in _SHAPES, f"an action has the shape {action.shape}, not (3,) or (7,)")
        require(np.isfinite(action).all(), f"an action is not finite: {action}")
        require(action.shape == first[0].shape, "actions have different shapes")
    again = _actions(policy)
    same = all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
    require(same, "after a reset the same observations give other actions")


def leaves_the_observation(policy: Any) -> None:
    """The observation is left as it was."""
    seen = observe(velocity_problem(0))
    before = {name: values.copy() for name, values in seen.items()}
    policy(seen)
    changed = [name for name in before if not np.array_equal(seen.get(name, np.nan), before[name])]
    require(not changed, f"the policy changes its observation: {', '.join(changed)}")


CHECKS = (
    Check(name="actions are finite, of one shape, and the same again", run=acts),
    Check(name="leaves the observation as it was", run=leaves_the_observation),
)
