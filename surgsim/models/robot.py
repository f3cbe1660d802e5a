"""The arms: where their models are, what their parts are called, and what their limits are.

A robot is a folder `assets/robots/<name>/` with `<name>.xml`, an MJCF that holds nothing but an arm: a chain
of n revolute joints.

- bodies `base`, `link1`..`link<n>`, joints `joint1`..`joint<n>`, torque motors `motor1`..`motor<n>` whose
  ctrlrange is the torque limit, and on the last link a site `flange` whose z is the tool axis;
- the numerics that MJCF has no attribute for, of n numbers each: `velocity_limit_rad_per_s`,
  `acceleration_limit_rad_per_s2`, and where they are published `jerk_limit_rad_per_s3` and
  `torque_rate_limit_nm_per_s`;
- for `base` and each link a numeric `capsule_<body>`, where collisions are looked for: two end points [m] in
  the body's frame and a radius [m];
- a text `description`.

`assets/test_arms/` holds arms of other numbers of joints, for tests: no real ones, and not listed.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import count, takewhile
from pathlib import Path
from typing import Self

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from surgsim.errors import SurgsimError, unknown_name
from surgsim.models.graft import asset
from surgsim.resources import resource_dir
from surgsim.spatial import Array

ROBOTS, TEST_ARMS = "robots", "test_arms"
"""Folders of `assets/`."""
_LITERAL_D2 = "literal_d2_m"
"""Numeric of the arm whose DH table a paper misprints: d2 as it stands there."""


def joint_names(model: mujoco.MjModel | mujoco.MjSpec) -> tuple[str, ...]:
    """Names of the arm's joints in `model`, from the base on: `joint1`, `joint2` and so on (n,)."""
    every = model.joints if isinstance(model, mujoco.MjSpec) else map(model.joint, range(model.njnt))
    known = {joint.name for joint in every}
    return tuple(takewhile(known.__contains__, (f"joint{i}" for i in count(1))))


def motor_names(n: int) -> tuple[str, ...]:
    """Names of the motors of an arm of n joints (n,)."""
    return tuple(f"motor{i}" for i in range(1, n + 1))


def link_names(n: int) -> tuple[str, ...]:
    """Names of the links of an arm of n joints (n,), the base left out."""
    return tuple(f"link{i}" for i in range(1, n + 1))


@dataclass(frozen=True, kw_only=True, eq=False)
class JointLimits:
    """What the joints can do. Arrays (n,), read-only.

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
        joints = joint_names(model)
        positions = np.array([model.joint(name).range for name in joints])
        torques = np.array([model.actuator(name).ctrlrange for name in motor_names(len(joints))])
        return cls(
            q_min=_frozen(positions[:, 0]),
            q_max=_frozen(positions[:, 1]),
            velocity=_frozen(model.numeric("velocity_limit_rad_per_s").data),
            acceleration=_frozen(model.numeric("acceleration_limit_rad_per_s2").data),
            torque=_frozen(torques[:, 1]),
            jerk=_optional(model, "jerk_limit_rad_per_s3", len(joints)),
            torque_rate=_optional(model, "torque_rate_limit_nm_per_s", len(joints)),
        )


def robot_names() -> list[str]:
    """Names of the shipped robots, sorted."""
    return sorted(path.stem for path in _files(ROBOTS))


def arms_for_tests() -> list[str]:
    """Names of the arms that are for tests alone, sorted: by their number of joints."""
    return sorted(path.stem for path in _files(TEST_ARMS))


def _files(folder: str) -> Iterator[Path]:
    """The MJCF of every arm of a folder of `assets/`."""
    for path in (resource_dir("assets") / folder).iterdir():
        if (file := path / f"{path.name}.xml").is_file():
            yield file


def known_robot(name: str) -> str:
    """`name`, if there is such an arm.

    Raises:
        ValueError: If there is not.
    """
    if name not in (*robot_names(), *arms_for_tests()):
        raise ValueError(unknown_name(name, "robot", robot_names()))
    return name


def robot_description(name: str) -> str:
    """One line about a robot, from its model.

    Raises:
        SurgsimError: If there is no such robot.
    """
    return str(robot_spec(name, drawn=False).text("description").data)


@lru_cache(maxsize=32)
def robot_joints(name: str) -> int:
    """Number of a robot's joints.

    Raises:
        SurgsimError: If there is no such robot.
    """
    return len(joint_names(robot_spec(name, drawn=False)))


def with_literal_variant() -> list[str]:
    """The robots whose DH table a paper prints otherwise, see `robot_spec`."""
    specs = {name: robot_spec(name, drawn=False) for name in robot_names()}
    return [name for name, spec in specs.items() if any(n.name == _LITERAL_D2 for n in spec.numerics)]


def robot_spec(name: str, dh_variant: str = "standard", *, drawn: bool = True) -> mujoco.MjSpec:
    """The arm alone, its base at the origin; `literal` moves link 3 along the axis of joint 2 by its d2.

    That is its numeric `literal_d2_m`, which only an arm whose DH table is misprinted has. Unless `drawn`,
    without what is only looked at.

    Raises:
        SurgsimError: If there is no such robot.
    """
    try:
        folder = ROBOTS if known_robot(name) in robot_names() else TEST_ARMS
    except ValueError as error:
        raise SurgsimError(str(error)) from error
    spec = asset(f"{folder}/{name}/{name}.xml", drawn=drawn)
    if dh_variant == "literal":
        axis = np.array(spec.joint("joint2").axis)
        link = spec.body("link3")
        link.pos = np.array(link.pos) + float(spec.numeric(_LITERAL_D2).data[0]) * axis
    return spec


def _optional(model: mujoco.MjModel, numeric: str, n: int) -> Array:
    """The n values of `numeric`, infinite in a model without it."""
    known = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, numeric) >= 0
    return _frozen(model.numeric(numeric).data if known else np.full(n, np.inf))


def _frozen(values: ArrayLike) -> Array:
    copy = np.array(values, dtype=np.float64)
    copy.flags.writeable = False
    return copy
