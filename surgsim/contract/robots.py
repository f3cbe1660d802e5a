"""What every robot's folder promises."""

import numpy as np

from surgsim.contract.check import Check, require
from surgsim.models.arm import ArmModel
from surgsim.models.build import build, build_arm
from surgsim.models.config import RobotConfig, SceneConfig
from surgsim.models.folders import named_spec
from surgsim.models.robot import what_is_missing

_POSTURES = 20


def _config(name: str) -> SceneConfig:
    return SceneConfig(robot=RobotConfig(name=name), theatre=False)


def has_the_form(name: str) -> None:
    """Bodies, joints, motors and the flange have their names, and the arm has 6 to 8 joints."""
    lack = what_is_missing(named_spec(name, drawn=False))
    require(lack is None, lack or "")


def has_limits(name: str) -> None:
    """Every joint has limits of position, velocity, acceleration and torque."""
    scene = build_arm(_config(name))
    limits = scene.limits
    require(np.all(limits.q_min < limits.q_max), f"a range is empty: {limits.q_min}, {limits.q_max}")
    for what in ("velocity", "acceleration", "torque", "jerk", "torque_rate"):
        values = getattr(limits, what)
        require(values.shape == limits.q_min.shape, f"{what} has {values.size} numbers")
        require(np.all(values > 0.0), f"{what} is not above zero: {values}")
    if scene.home is not None:
        inside = np.all((scene.home >= limits.q_min) & (scene.home <= limits.q_max))
        require(inside, f"home_rad is outside the ranges: {scene.home}")


def is_physical(name: str) -> None:
    """Inertia is positive definite in random postures, and links are where contacts are looked for."""
    arm, rng = ArmModel(_config(name)), np.random.default_rng(0)
    low, high = arm.limits.q_min, arm.limits.q_max
    for _ in range(_POSTURES):
        dynamics = arm.dynamics(rng.uniform(low, high), np.zeros(len(low)))
        least = float(np.linalg.eigvalsh(dynamics.mass_matrix).min())
        require(least > 0.0, f"the inertia is not positive definite: {least:.3g} kg m^2")
    capsules = [part for part in arm.scene.shapes.names if part not in ("adapter", "shaft")]
    require(capsules, "there is no capsule: contacts of the arm are never noticed")


def is_drawn(name: str) -> None:
    """It can be built with what is looked at."""
    drawn, bare = build(_config(name)), build_arm(_config(name))
    require(drawn.model.nv == bare.model.nv, "the drawn arm has other joints")


CHECKS = (
    Check(name="has the form of an arm", run=has_the_form),
    Check(name="has limits", run=has_limits),
    Check(name="is physical", run=is_physical),
    Check(name="can be drawn", run=is_drawn),
)
