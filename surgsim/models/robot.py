"""The arms: where their models are and what their limits are.

A robot is a folder `assets/<name>/` with `<name>.xml`, an MJCF that holds nothing but the arm: bodies
`base`, `link1`..`link7`, joints `joint1`..`joint7`, torque motors `motor1`..`motor7` whose ctrlrange is
the torque limit, a site `flange` whose z is the tool axis, and the numerics that MJCF has no attribute
for: `velocity_limit_rad_per_s`, `acceleration_limit_rad_per_s2`, and where they are published
`jerk_limit_rad_per_s3` and `torque_rate_limit_nm_per_s`.
"""

from dataclasses import dataclass
from typing import Self, get_args

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from surgsim.errors import SurgsimError, unknown_name
from surgsim.models.config import RobotName
from surgsim.models.graft import asset
from surgsim.spatial import Array

JOINTS = tuple(f"joint{i}" for i in range(1, 8))
MOTORS = tuple(f"motor{i}" for i in range(1, 8))
LITERAL_D2_M = 0.2
"""d2 of the LWR4+ as printed in Table 3 of the manipulability paper."""


@dataclass(frozen=True, kw_only=True, eq=False)
class JointLimits:
    """What the joints can do. Arrays (7,), read-only.

    Attributes:
        q_min: Lowest position [rad].
        q_max: Highest position [rad].
        velocity: Largest speed either way [rad/s].
        acceleration: Largest acceleration either way [rad/s²].
        torque: Largest motor torque either way [N m].
        jerk: Largest jerk either way [rad/s³]; infinite where none is published.
        torque_rate: Fastest change of torque either way [N m/s]; infinite where none is published.
    """

    q_min: Array
    q_max: Array
    velocity: Array
    acceleration: Array
    torque: Array
    jerk: Array
    torque_rate: Array

    @classmethod
    def of(cls, model: mujoco.MjModel) -> Self:
        """Limits that the compiled `model` states."""
        positions = np.array([model.joint(name).range for name in JOINTS])
        torques = np.array([model.actuator(name).ctrlrange for name in MOTORS])
        return cls(
            q_min=_frozen(positions[:, 0]),
            q_max=_frozen(positions[:, 1]),
            velocity=_frozen(model.numeric("velocity_limit_rad_per_s").data),
            acceleration=_frozen(model.numeric("acceleration_limit_rad_per_s2").data),
            torque=_frozen(torques[:, 1]),
            jerk=_optional(model, "jerk_limit_rad_per_s3"),
            torque_rate=_optional(model, "torque_rate_limit_nm_per_s"),
        )


def robot_names() -> list[str]:
    """Names of the shipped robots, sorted."""
    return sorted(get_args(RobotName))


def robot_description(name: str) -> str:
    """One line about a robot, from its model.

    Raises:
        SurgsimError: If there is no such robot.
    """
    return str(robot_spec(name, drawn=False).text("description").data)


def robot_spec(name: str, dh_variant: str = "standard", *, drawn: bool = True) -> mujoco.MjSpec:
    """The arm alone, its base at the origin; `literal` moves link 3 along the axis of joint 2 by d2 = 0.2 m.

    Unless `drawn`, without what is only looked at.

    Raises:
        SurgsimError: If there is no such robot.
    """
    if name not in robot_names():
        raise SurgsimError(unknown_name(name, "robot", robot_names()))
    spec = asset(f"{name}/{name}.xml", drawn=drawn)
    if dh_variant == "literal":
        axis = np.array(spec.joint("joint2").axis)
        link = spec.body("link3")
        link.pos = np.array(link.pos) + LITERAL_D2_M * axis
    return spec


def _optional(model: mujoco.MjModel, numeric: str) -> Array:
    """The seven values of `numeric`, infinite in a model without it."""
    known = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, numeric) >= 0
    return _frozen(model.numeric(numeric).data if known else np.full(7, np.inf))


def _frozen(values: ArrayLike) -> Array:
    copy = np.array(values, dtype=np.float64)
    copy.flags.writeable = False
    return copy
