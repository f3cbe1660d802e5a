"""What the joints of an arm can do: from the scenario, else the file, else assumed where that is harmless."""

from dataclasses import dataclass

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.models.adopted.chain import Chain
from surgsim.models.adopted.config import ArmFileConfig
from surgsim.models.adopted.file import ModelFile
from surgsim.models.adopted.problem import AdoptionError, listed

ASSUMED_VELOCITY_RAD_PER_S = 3.14159
ASSUMED_ACCELERATION_RAD_PER_S2 = 5.23599
"""300 deg/s², as is used for arms whose makers publish none."""
TURN_RAD = 6.28318
"""How far either way a joint without limits is let turn: one turn."""
_ON_JOINTS = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)  # the same for a hinge
_VELOCITY, _ACCELERATION = "velocity_limit_rad_per_s", "acceleration_limit_rad_per_s2"


@dataclass(frozen=True, kw_only=True, eq=False)
class Limits:
    """Limits of the joints, each (n,), and where they are from.

    Attributes:
        position: Lowest and highest (n, 2) [rad].
        velocity: [rad/s].
        acceleration: [rad/s²].
        torque: [N m].
        sources: What is limited to where the numbers are from.
        assumed: Sentences about numbers that nobody stated.
    """

    position: Array
    velocity: Array
    acceleration: Array
    torque: Array
    sources: dict[str, str]
    assumed: tuple[str, ...]


def find_limits(file: ModelFile, chain: Chain, robot: ArmFileConfig) -> Limits:
    """Limits of the arm in `file`; what `robot.limits` gives counts before what the file says.

    Raises:
        AdoptionError: If a joint has no torque limit anywhere, or a list has not one number for each joint.
    """
    model, given = file.model, robot.limits
    names = [model.joint(j).name or f"number {j}" for j in chain.joints]
    sources: dict[str, str] = {"position": "the file"}
    assumed: list[str] = []

    def chosen(what: str, key: str, listed_values: tuple[float, ...] | None, found: Array) -> Array:
        if listed_values is not None:
            sources[what] = f"robot.limits.{key}"
            return _listed(listed_values, names, key)
        sources[what] = "the file"
        return found

    position = _positions(model, chain, names, assumed)
    velocity = chosen("velocity", "velocity_rad_per_s", given.velocity_rad_per_s, _velocities(file, names))
    velocity = _filled(velocity, "velocity", ASSUMED_VELOCITY_RAD_PER_S, "rad/s", names, sources, assumed)
    acceleration = chosen(
        "acceleration",
        "acceleration_rad_per_s2",
        given.acceleration_rad_per_s2,
        _numeric(model, _ACCELERATION, len(names)),
    )
    acceleration = _filled(
        acceleration, "acceleration", ASSUMED_ACCELERATION_RAD_PER_S2, "rad/s^2", names, sources, assumed
    )
    torque = chosen("torque", "torque_nm", given.torque_nm, _torques(file, chain, names))
    lacking = [name for name, value in zip(names, torque, strict=True) if not np.isfinite(value)]
    if lacking:
        raise AdoptionError(
            f"no torque limit of joint {listed(lacking)} in the file: no motor with a "
            f"ctrlrange both ways, no forcerange, actuatorfrcrange or effort. Give limits: "
            f"{{torque_nm: [{len(names)} numbers]}}.",
            "limits",
        )
    return Limits(
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        torque=torque,
        sources=sources,
        assumed=tuple(assumed),
    )


def _listed(values: tuple[float, ...], names: list[str], key: str) -> Array:
    if len(values) != len(names):
        raise AdoptionError(
            f"{key} has {len(values)} numbers; the arm has {len(names)} joints", "limits", key
        )
    return np.array(values, dtype=float)


def _filled(
    values: Array,
    what: str,
    by: float,
    unit: str,
    names: list[str],
    sources: dict[str, str],
    assumed: list[str],
) -> Array:
    """`values` with `by` where there is none."""
    lacking = ~np.isfinite(values)
    if lacking.any():
        sources[what] = "assumed" if lacking.all() else f"{sources[what]}, in part assumed"
        which = "of every joint" if lacking.all() else f"of {listed(np.array(names)[lacking].tolist())}"
        assumed.append(f"{what} limit {which}: {by:g} {unit}, the file states none")
    return np.where(lacking, by, values)


def _positions(model: mujoco.MjModel, chain: Chain, names: list[str], assumed: list[str]) -> Array:
    """Ranges (n, 2) [rad]; one turn either way of a joint that has none."""
    joints = list(chain.joints)
    endless = ~model.jnt_limited[joints].astype(bool)
    ranges = np.array(model.jnt_range[joints], dtype=float)
    ranges[endless] = -TURN_RAD, TURN_RAD
    if endless.any():
        which = listed(np.array(names)[endless].tolist())
        assumed.append(f"range of {which}: one turn either way, the file sets no limits")
    return ranges


def _velocities(file: ModelFile, names: list[str]) -> Array:
    if file.velocity:
        return np.array([file.velocity.get(name, np.inf) for name in names])
    return _numeric(file.model, _VELOCITY, len(names))


def _numeric(model: mujoco.MjModel, name: str, n: int) -> Array:
    """A numeric of the file, where it has n values; else infinite."""
    found = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, name)
    if found < 0 or model.numeric_size[found] != n:
        return np.full(n, np.inf)
    return np.array(model.numeric(name).data, dtype=float)


def _torques(file: ModelFile, chain: Chain, names: list[str]) -> Array:
    """Least of what the file says of each joint [N m]: motor, force range of servo and joint, effort."""
    model = file.model
    torques = np.array([file.effort.get(name, np.inf) for name in names])
    for i, joint in enumerate(chain.joints):
        if model.jnt_actfrclimited[joint]:
            torques[i] = min(torques[i], _either_way(model.jnt_actfrcrange[joint]))
        for actuator in range(model.nu):
            kind = int(model.actuator_trntype[actuator])
            if kind in _ON_JOINTS and model.actuator_trnid[actuator, 0] == joint:
                torques[i] = min(torques[i], _torque_of(model, actuator))
    return np.where(torques > 0.0, torques, np.inf)


def _torque_of(model: mujoco.MjModel, actuator: int) -> float:
    """Largest torque [N m] of an actuator; infinite where it has no limit that says so."""
    gear = abs(float(model.actuator_gear[actuator, 0]))
    least = np.inf
    if model.actuator_forcelimited[actuator]:
        least = gear * _either_way(model.actuator_forcerange[actuator])
    motor = (
        model.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_NONE
        and model.actuator_gaintype[actuator] == mujoco.mjtGain.mjGAIN_FIXED
    )
    if motor and model.actuator_ctrllimited[actuator]:
        gain = abs(float(model.actuator_gainprm[actuator, 0]))
        least = min(least, gear * gain * _either_way(model.actuator_ctrlrange[actuator]))
    return float(least)


def _either_way(pair: Array) -> float:
    """What is reached both ways."""
    return float(min(abs(pair[0]), abs(pair[1])))
