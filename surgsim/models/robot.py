"""An arm's model: what its parts are called, and what its limits are.

Every arm, of a robot's folder or from somebody's own file, has this form: an MJCF that holds nothing but a
chain of n revolute joints.

- bodies `base`, `link1`..`link<n>`, joints `joint1`..`joint<n>`, torque motors `motor1`..`motor<n>` whose
  ctrlrange is the torque limit, and on the last link a site `flange` whose z is the tool axis;
- the numerics that MJCF has no attribute for, of n numbers each: `velocity_limit_rad_per_s`,
  `acceleration_limit_rad_per_s2`, and where they are published `jerk_limit_rad_per_s3` and
  `torque_rate_limit_nm_per_s`; and `home_rad`, a posture to prefer, where there is one;
- for `base` and each link a numeric `capsule_<body>`, where collisions are looked for: two end points [m] in
  the body's frame and a radius [m], as often as there are capsules;
- a text `never_touch`, pairs such as `base-link3 link2-adapter` that are not looked at, where there are any;
- a text `description`.
"""

from dataclasses import dataclass, fields
from functools import lru_cache
from itertools import count, takewhile
from typing import Self

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from surgsim.array import Array
from surgsim.errors import SurgsimError
from surgsim.models.adopted.arm import adopted
from surgsim.models.adopted.chain import FEWEST, MOST
from surgsim.models.config import RobotConfig
from surgsim.models.folders import LITERAL_D2, is_shipped, named_spec
from surgsim.models.named import Named


def joint_names(model: mujoco.MjModel | mujoco.MjSpec | Named) -> tuple[str, ...]:
    """Names of the arm's joints in `model`, from the base on: `joint1`, `joint2` and so on (n,)."""
    if isinstance(model, mujoco.MjSpec):
        known = {joint.name for joint in model.joints}
    else:
        known = set((model if isinstance(model, Named) else Named(model)).joints().values())
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
    def of(cls, model: Named) -> Self:
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

    def published(self) -> dict[str, list[float]]:
        """The limits by name, a plain number for each joint; without those that are not published."""
        named = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: values.tolist() for name, values in named.items() if np.isfinite(values).all()}


def robot_description(name: str) -> str:
    """One line about a robot of a folder, from its model.

    Raises:
        SurgsimError: If there is no such robot.
    """
    spec = named_spec(name, drawn=False)
    return next((str(text.data) for text in spec.texts if text.name == "description"), "no description")


@lru_cache(maxsize=64)
def robot_joints(robot: RobotConfig) -> int:
    """Number of a robot's joints.

    Raises:
        SurgsimError: If there is no such robot.
    """
    return len(joint_names(robot_spec(robot, drawn=False)))


def robot_spec(robot: RobotConfig, *, drawn: bool = True) -> mujoco.MjSpec:
    """The arm alone, its base at the origin; unless `drawn` without what is only looked at.

    `dh_variant: literal` moves link 3 along the axis of joint 2 by the arm's numeric `literal_d2_m`, which
    only an arm whose DH table is misprinted has.

    Raises:
        SurgsimError: If there is no such robot.
    """
    if robot.name is None:
        return adopted(robot).spec(drawn=drawn)
    spec = named_spec(robot.name, drawn=drawn)
    if not is_shipped(robot.name) and (lack := what_is_missing(spec)):
        raise SurgsimError(f"robot '{robot.name}' has not the form of an arm: {lack}")
    if robot.dh_variant == "literal":
        axis = np.array(spec.joint("joint2").axis)
        link = spec.body("link3")
        link.pos = np.array(link.pos) + float(spec.numeric(LITERAL_D2).data[0]) * axis
    return spec


def what_is_missing(spec: mujoco.MjSpec) -> str | None:
    """What an arm has not, or has too much, of the form that this module states; None if nothing."""
    n = len(joint_names(spec))
    if not FEWEST <= n <= MOST:
        return f"it has {n} joints named joint1, joint2 and so on, not {FEWEST} to {MOST}"
    if len(spec.joints) != n:
        return "it has joints beside those of the arm"
    parts = (
        ("body", spec.bodies, ("base", *link_names(n))),
        ("motor", spec.actuators, motor_names(n)),
        ("site", spec.sites, ("flange",)),
        ("text", spec.texts, ("description",)),
        ("numeric", spec.numerics, ("velocity_limit_rad_per_s", "acceleration_limit_rad_per_s2")),
    )
    for kind, there, wanted in parts:
        names = {part.name for part in there}
        missing = [name for name in wanted if name not in names]
        if missing:
            return f"there is no {kind} {', '.join(missing)}"
    return None


def home_of(model: Named) -> Array | None:
    """The arm's own home posture (n,) [rad], where it has one."""
    known = model.find(mujoco.mjtObj.mjOBJ_NUMERIC, "home_rad") >= 0
    return _frozen(model.numeric("home_rad").data) if known else None


def _optional(model: Named, numeric: str, n: int) -> Array:
    """The n values of `numeric`, infinite in a model without it."""
    known = model.find(mujoco.mjtObj.mjOBJ_NUMERIC, numeric) >= 0
    return _frozen(model.numeric(numeric).data if known else np.full(n, np.inf))


def _frozen(values: ArrayLike) -> Array:
    copy = np.array(values, dtype=np.float64)
    copy.flags.writeable = False
    return copy
