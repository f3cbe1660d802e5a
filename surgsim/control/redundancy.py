"""What a part of a controller says of the degrees of freedom beside those that its tasks take.

How many it needs, whether others may move them, and whether it follows a commanded roll.
"""

from surgsim.control.resolvers.base import ResolverConfig
from surgsim.control.torque_laws.base import TorqueLawConfig
from surgsim.errors import SurgsimError
from surgsim.models.arm import ArmModel


def redundancy_needed(config: object) -> int:
    """Degrees of freedom that the part of `config` needs when the tip, and with a trocar the shaft, are held.

    A config says it as `needs_redundancy`; 0 if it does not. The roll about the shaft does not count, see
    `ArmModel.redundancy`.
    """
    return int(getattr(config, "needs_redundancy", 0))


def shares_null_space(config: object) -> bool:
    """Whether null-space motion may be added to the answers of the resolver of `config`.

    A config says it as `shares_null_space`; False if it does not, as of one that plans the posture itself or
    answers from outside surgsim.
    """
    return bool(getattr(config, "shares_null_space", False))


def follows_roll(config: object) -> bool:
    """Whether the part of `config` moves the roll about the shaft as commanded, `follows_roll` of it."""
    return bool(getattr(config, "follows_roll", False))


def check_redundancy(
    config: ResolverConfig | TorqueLawConfig | None, arm: ArmModel, has_trocar: bool
) -> None:
    """Refuse a part that needs more than the arm has.

    Raises:
        SurgsimError: With the reason, in one line.
    """
    needed, left, joints = redundancy_needed(config), arm.redundancy(has_trocar), arm.limits.q_min.size
    if config is None or left >= needed:
        return
    held = "tip and shaft are" if has_trocar else "the tip is"
    free = f"{needed} degree{'s' if needed != 1 else ''} of freedom"
    has = f"has {left or 'none'} left" if left >= 0 else f"is {-left} short of it"
    roll = ", the roll about the shaft not counted" if arm.rolls_shaft else ""
    text = f"'{config.type}' needs {free} while {held} held"
    raise SurgsimError(f"{text}; an arm of {joints} joints {has}{roll}")
