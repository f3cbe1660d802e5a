"""The arm that most tests of one part are on, and random problems for it."""

from functools import lru_cache, partial

from surgsim.contract import problems
from surgsim.models.arm import ArmModel
from surgsim.models.config import RobotConfig, SceneConfig


@lru_cache(maxsize=1)
def usual_arm() -> ArmModel:
    """LWR4+ with the default instrument."""
    return ArmModel(SceneConfig(robot=RobotConfig(name="lwr4plus")))


random_q = partial(problems.random_q, usual_arm())
velocity_problem = partial(problems.velocity_problem, usual_arm())
torque_problem = partial(problems.torque_problem, usual_arm())
