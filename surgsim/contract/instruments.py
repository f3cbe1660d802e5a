"""What the file of every instrument with a name promises."""

import numpy as np

from surgsim.contract.check import Check, require
from surgsim.models.arm import ArmModel
from surgsim.models.build import build, build_arm
from surgsim.models.config import InstrumentConfig, RobotConfig, SceneConfig
from surgsim.models.folders import shipped_robots

_POSTURES = 20
_ON_SHAFT_M = 1e-9


def _config(name: str) -> SceneConfig:
    robot = RobotConfig(name=shipped_robots()[0])
    return SceneConfig(robot=robot, instrument=InstrumentConfig(name=name), theatre=False)


def has_the_form(name: str) -> None:
    """The file is read as an instrument: sites of shaft and tip, lengths, mass."""
    tool = InstrumentConfig(name=name).tool
    require(tool.mass > 0.0, "it has no mass")


def shaft_is_a_line(name: str) -> None:
    """On an arm entry and end of the shaft are on a line along the shaft's z, in random postures."""
    arm, rng = ArmModel(_config(name)), np.random.default_rng(0)
    low, high = arm.limits.q_min, arm.limits.q_max
    for _ in range(_POSTURES):
        kin = arm.kinematics(rng.uniform(low, high))
        entry = kin.p_WT + kin.R_WT @ arm.p_TA
        off = float(np.linalg.norm(np.cross(kin.p_WS - entry, kin.R_WT[:, 2])))
        require(off < _ON_SHAFT_M, f"the shaft's end is {off:.3g} m off the shaft's line")


def is_physical(name: str) -> None:
    """Its inertia is possible, and an arm's inertia with it is positive definite in random postures."""
    inertia = InstrumentConfig(name=name).tool.inertia
    require(np.all(inertia > 0.0), f"a principal moment of inertia is not above zero: {inertia} kg m^2")
    arm, rng = ArmModel(_config(name)), np.random.default_rng(0)
    low, high = arm.limits.q_min, arm.limits.q_max
    for _ in range(_POSTURES):
        dynamics = arm.dynamics(rng.uniform(low, high), np.zeros(len(low)))
        least = float(np.linalg.eigvalsh(dynamics.mass_matrix).min())
        require(least > 0.0, f"the arm's inertia with it is not positive definite: {least:.3g} kg m^2")


def is_drawn(name: str) -> None:
    """It can be built with what is looked at."""
    drawn, bare = build(_config(name)), build_arm(_config(name))
    require(drawn.model.nv == bare.model.nv, "drawn, the arm has other joints")


CHECKS = (
    Check(name="has the form of an instrument", run=has_the_form),
    Check(name="its shaft is a line", run=shaft_is_a_line),
    Check(name="is physical", run=is_physical),
    Check(name="can be drawn", run=is_drawn),
)
