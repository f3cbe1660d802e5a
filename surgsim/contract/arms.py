"""The arms that parts are tested on: of 6, 7 and 8 joints, the last without a roll about the shaft."""

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import Any

from surgsim.contract.check import BrokenPromiseError
from surgsim.control.redundancy import redundancy_needed
from surgsim.errors import told
from surgsim.models.arm import ArmModel
from surgsim.models.config import RobotConfig, SceneConfig, TrocarConfig
from surgsim.models.folders import arms_for_tests

_PORT = TrocarConfig(position_m=(0.0, 0.55, 0.2))


@lru_cache(maxsize=1)
def scenes() -> tuple[SceneConfig, ...]:
    """Each arm with the default instrument and a trocar."""
    return tuple(
        SceneConfig(robot=RobotConfig(name=name), trocar=_PORT, theatre=False) for name in arms_for_tests()
    )


@lru_cache(maxsize=8)
def arm_of(scene: SceneConfig) -> ArmModel:
    """The nominal arm of a scene."""
    return ArmModel(scene)


def on_every_arm(check: Callable[[Any, SceneConfig], None]) -> Callable[[Any], None]:
    """`check` of a part on each arm; what is said of a broken promise begins with the arm's joints."""

    @wraps(check)
    def run(part: Any) -> None:
        for scene in scenes():
            try:
                check(part, scene)
            except Exception as error:  # whatever a foreign part raises is its answer
                joints = arm_of(scene).limits.q_min.size
                reason = str(error) if isinstance(error, BrokenPromiseError) else told(error)
                raise BrokenPromiseError(f"{joints} joints: {reason or type(error).__name__}") from error

    return run


def cases(config: Any, arm: ArmModel) -> list[bool]:
    """With a trocar, and without one: where the arm has the redundancy that the part of `config` needs."""
    return [trocar for trocar in (True, False) if arm.redundancy(trocar) >= redundancy_needed(config)]
