"""Learning environments: a scenario in which an agent takes the place of the controller."""

from typing import TYPE_CHECKING, Any

from surgsim.control.policies.registry import policy_names, register_policy
from surgsim.packages import ENVIRONMENT, require

if TYPE_CHECKING:
    from surgsim.env.environment import load

__all__ = ["load", "policy_names", "register_policy"]


def __getattr__(name: str) -> Any:
    if name == "load":  # dm_control is imported once an environment is wanted
        require("learning environments need", *ENVIRONMENT)
        from surgsim.env.environment import load

        return load
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
