"""What every policy promises."""

from typing import Any

import numpy as np

from surgsim.array import Array
from surgsim.contract.arms import arm_of, on_every_arm
from surgsim.contract.check import Check, require
from surgsim.contract.problems import velocity_problem
from surgsim.control.policies.observation import observe
from surgsim.control.seen import seen_of_velocity
from surgsim.models.arm import ArmModel
from surgsim.models.config import SceneConfig
from surgsim.tick.fields import fields_of


def _seen(arm: ArmModel, seed: int) -> dict[str, Array]:
    """A random observation."""
    return observe(fields_of(seen_of_velocity(velocity_problem(arm, seed), arm)))


def _actions(policy: Any, arm: ArmModel) -> list[Array]:
    """Actions on ten observations from a reset on."""
    reset = getattr(policy, "reset", None)
    if callable(reset):
        reset()
    return [np.array(policy(_seen(arm, seed)), dtype=float) for seed in range(10)]


@on_every_arm
def acts(policy: Any, scene: SceneConfig) -> None:
    """Finite actions of three entries (tip) or one for each joint, the same again after a reset."""
    arm = arm_of(scene)
    first, joints = _actions(policy, arm), arm.limits.q_min.shape
    for action in first:
        shape = action.shape
        require(shape in ((3,), joints), f"an action has the shape {shape}, not (3,) or {joints}")
        require(np.isfinite(action).all(), f"an action is not finite: {action}")
        require(action.shape == first[0].shape, "actions have different shapes")
    again = _actions(policy, arm)
    same = all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
    require(same, "after a reset the same observations give other actions")


@on_every_arm
def leaves_the_observation(policy: Any, scene: SceneConfig) -> None:
    """The observation is left as it was."""
    seen = _seen(arm_of(scene), 0)
    before = {name: values.copy() for name, values in seen.items()}
    policy(seen)
    changed = [name for name in before if not np.array_equal(seen.get(name, np.nan), before[name])]
    require(not changed, f"the policy changes its observation: {', '.join(changed)}")


CHECKS = (
    Check(name="actions are finite, of one shape, and the same again", run=acts),
    Check(name="leaves the observation as it was", run=leaves_the_observation),
)
