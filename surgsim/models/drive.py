"""Drives of an arm's joints: what stands between the commanded torque and the link.

A drive is a motor behind an elastic gear, with a torque loop around both:

    M q'' + c = tau_J + tau_ext                              links, without the motors' inertia
    B theta'' + tau_J = tau_m - tau_f                        motor, as the joint feels it
    tau_J = K (theta - q) + D (theta' - q')                  gear
    tau_m = (B/B_s) (u - D_s (theta' - q')) + (1 - B/B_s) tau_J,    D_s = 2 zeta sqrt(K B_s)

The torque loop makes the motor appear with the inertia B_s = B / inertia_shaping, and its friction tau_f
divided by the same number: B_s theta'' + tau_J = u - D_s (theta' - q') - tau_f B_s / B.

Source: Spong, J. Dyn. Sys., Meas., Control 109:310 (1987), for the model; Ott, Cartesian Impedance Control of
Redundant and Flexible-Joint Robots (2008), section 3.2, for the torque loop.
"""

import json
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat
from ruamel.yaml import YAML, YAMLError

from surgsim.array import Array
from surgsim.catalog import ADDED, PartConfig

FILE = "drive.yaml"
"""In a robot's folder: what its real drives are."""
Positive = PositiveFloat | tuple[PositiveFloat, ...]
NotNegative = NonNegativeFloat | tuple[NonNegativeFloat, ...]
"""A number for all joints, or one for each from the base on (n,)."""


class DriveConfig(PartConfig):
    """Real drives. What is not given is what the robot's folder says of its own.

    Attributes:
        stiffness_nm_per_rad: K of each gear with its torque sensor [N m/rad].
        gear_damping_nm_s_per_rad: D of each gear [N m s/rad].
        rotor_inertia_kg_m2: B of each motor, as its joint feels it [kg m^2].
        inertia_shaping: B over the inertia B_s with which the torque loop lets a motor appear; 1: as it is.
        loop_damping_ratio: zeta of the damping that the torque loop gives a motor on its gear.
        loop_cutoff_hz: Cut-off of the first-order lag of the motor's torque [Hz].
        loop_delay_s: Age of the torque and the speed that the torque loop is closed on [s].
        coulomb_nm: Dry friction of each motor, before the torque loop [N m].
        viscous_nm_s_per_rad: Viscous friction of each motor, before the torque loop [N m s/rad].
        static_nm: Dry friction at rest [N m]; null: the same as in motion.
        stribeck_velocity_rad_per_s: Over which it falls from static to dry friction [rad/s].
        friction_spread: Relative spread of the friction over seeds, drawn for each joint.
        friction_observer_hz: Cut-off of a friction observer inside the torque loop [Hz]; 0: there is none.
        ripple_nm: Amplitude of the gear's torque ripple, before the torque loop [N m].
        ripple_per_turn: Its periods in a turn of the joint.
        sensor_bias_nm: Bias of each torque sensor, its sign drawn [N m].
        sensor_ripple_nm: Amplitude of each torque sensor's ripple [N m].
        encoder: Side of the gear on which the encoders sit. On the motors' side the position is reported less
            the measured torque over K, as arms do, and the velocity as it is there.
        torque_rate_nm_per_s: Fastest change of the commanded torque that the arm's interface takes [N m/s];
            null: any.
        past_torque_rate: What the interface does with a faster one: `clip` it, `stop` the run with an outcome
            as the arm's reflex, or `ignore` it.
        command_cutoff_hz: Cut-off of the interface's low-pass of the commanded torque [Hz]; null: none.
        command: What the arm is commanded: joint `torque`, or joint positions for its own impedance loop,
            with a torque beside them (`joint_impedance`).
        impedance_stiffness_nm_per_rad: K_j of that loop [N m/rad].
        impedance_damping_ratio: zeta of its damping D_j = 2 zeta sqrt(K_j M_jj).
        joint_acceleration_rad_per_s2: Largest commanded joint acceleration that the interface takes
            [rad/s^2]; null: any.
        joint_jerk_rad_per_s3: Largest commanded joint jerk that it takes [rad/s^3]; null: any.
        past_joint_motion: What it does with more: `clip` it, `stop` the run with an outcome as the arm's
            reflex, or `ignore` it.

    Example:
        >>> DriveConfig(stiffness_nm_per_rad=1e4, rotor_inertia_kg_m2=0.6).inertia_shaping
        4.0
    """

    stiffness_nm_per_rad: Positive | None = None
    gear_damping_nm_s_per_rad: NotNegative = 0.0
    rotor_inertia_kg_m2: Positive | None = None
    inertia_shaping: Annotated[float, Field(ge=1.0, le=100.0)] = 4.0
    loop_damping_ratio: Annotated[float, Field(ge=0.0, le=2.0)] = 0.5
    loop_cutoff_hz: Annotated[float, Field(ge=10.0, le=1e5)] = 1000.0
    loop_delay_s: Annotated[float, Field(ge=0.0, le=0.002)] = 0.0002
    coulomb_nm: NotNegative = 0.0
    viscous_nm_s_per_rad: NotNegative = 0.0
    static_nm: NotNegative | None = None
    stribeck_velocity_rad_per_s: Annotated[float, Field(ge=0.001, le=10.0)] = 0.05
    friction_spread: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    friction_observer_hz: Annotated[float, Field(ge=0.0, le=500.0)] = 0.0
    ripple_nm: NotNegative = 0.0
    ripple_per_turn: Annotated[int, Field(ge=1, le=10000)] = 320
    sensor_bias_nm: NotNegative = 0.0
    sensor_ripple_nm: NotNegative = 0.0
    encoder: Literal["link", "motor"] = "link"
    torque_rate_nm_per_s: PositiveFloat | None = None
    past_torque_rate: Literal["clip", "stop", "ignore"] = "clip"
    command_cutoff_hz: PositiveFloat | None = None
    command: Annotated[Literal["torque", "joint_impedance"], ADDED] = "torque"
    impedance_stiffness_nm_per_rad: Annotated[Positive, ADDED] = 1000.0
    impedance_damping_ratio: Annotated[NotNegative, ADDED] = 0.7
    joint_acceleration_rad_per_s2: Annotated[Positive | None, ADDED] = None
    joint_jerk_rad_per_s3: Annotated[Positive | None, ADDED] = None
    past_joint_motion: Annotated[Literal["clip", "stop", "ignore"], ADDED] = "clip"

    @property
    def impedes(self) -> bool:
        """Whether the arm's own impedance loop is commanded."""
        return self.command == "joint_impedance"

    def on(self, real: "DriveConfig | None") -> Self:
        """These drives, with what is not given here as in `real`.

        Raises:
            ValueError: If stiffness or inertia is known from neither, static is below dry friction, or joint
                motion is limited where none is commanded.
        """
        given = {key: getattr(self, key) for key in self.model_fields_set}
        every = {} if real is None else {key: getattr(real, key) for key in real.model_fields_set}
        whole = type(self)(**{**every, **given})
        for key in ("stiffness_nm_per_rad", "rotor_inertia_kg_m2"):
            if getattr(whole, key) is None:
                raise ValueError(f"give {key}: the robot's folder has no {FILE} that says it")
        if whole.static_nm is not None and _below(whole.static_nm, whole.coulomb_nm):
            raise ValueError(f"static_nm {whole.static_nm} must be at least coulomb_nm {whole.coulomb_nm}")
        for key in ("joint_acceleration_rad_per_s2", "joint_jerk_rad_per_s3"):
            if getattr(whole, key) is not None and not whole.impedes:
                raise ValueError(f"{key} is of commanded joint positions: it needs command joint_impedance")
        return whole

    def check_lengths(self, n: int) -> None:
        """Refuse a list that has not one item for each of `n` joints.

        Raises:
            ValueError: For the first one.
        """
        for key in type(self).model_fields:
            given = getattr(self, key)
            if isinstance(given, tuple) and len(given) != n:
                raise ValueError(f"{key} has {len(given)} items for an arm of {n} joints")

    def values(self, n: int) -> "Drive":
        """The drives of an arm of `n` joints, whose lists have that length."""
        shaping = self.inertia_shaping
        stiffness, rotor = self.each("stiffness_nm_per_rad", n), self.each("rotor_inertia_kg_m2", n)
        apparent = rotor / shaping
        rate = np.inf if self.torque_rate_nm_per_s is None else self.torque_rate_nm_per_s
        return Drive(
            stiffness=stiffness,
            gear_damping=self.each("gear_damping_nm_s_per_rad", n),
            rotor_inertia=rotor,
            apparent_inertia=apparent,
            loop_damping=2.0 * self.loop_damping_ratio * np.sqrt(stiffness * apparent),
            torque_rate=float(rate),
            impedance=self._impedance(n) if self.impedes else None,
        )

    def _impedance(self, n: int) -> "Impedance":
        """The arm's own impedance loop of `n` joints."""
        stiffness = self.each("impedance_stiffness_nm_per_rad", n)
        return Impedance(stiffness=stiffness, damping_ratio=self.each("impedance_damping_ratio", n))

    def each(self, key: str, n: int) -> Array:
        """The numbers of a key for `n` joints (n,)."""
        return np.broadcast_to(np.array(getattr(self, key), dtype=np.float64), (n,)).copy()


@dataclass(frozen=True, kw_only=True, eq=False)
class Impedance:
    """What a controller may know of the arm's own impedance loop. Arrays (n,).

    Attributes:
        stiffness: K_j [N m/rad].
        damping_ratio: zeta.
    """

    stiffness: Array
    damping_ratio: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Drive:
    """What a controller may know of the drives. Arrays (n,).

    Attributes:
        stiffness: K [N m/rad].
        gear_damping: D [N m s/rad].
        rotor_inertia: B [kg m^2].
        apparent_inertia: B_s [kg m^2].
        loop_damping: D_s [N m s/rad].
        torque_rate: Fastest change of the commanded torque [N m/s].
        impedance: The arm's own impedance loop; None where torque is commanded.
    """

    stiffness: Array
    gear_damping: Array
    rotor_inertia: Array
    apparent_inertia: Array
    loop_damping: Array
    torque_rate: float
    impedance: Impedance | None = None


def real_drive(folder: Path) -> DriveConfig | None:
    """The drives that a robot's folder states in `drive.yaml`; None where it has none.

    Raises:
        ValueError: If the file is no such thing.
    """
    file = folder / FILE
    if not file.is_file():
        return None
    try:
        return _drive_of(file.read_text(encoding="utf-8"))
    except (ValueError, YAMLError) as error:  # of pydantic, too
        raise ValueError(f"{file}: {' '.join(str(error).split())}") from error


@lru_cache(maxsize=32)
def _drive_of(text: str) -> DriveConfig:
    """Drives as a file's text states them; every scenario of a batch asks for the same few."""
    return DriveConfig.model_validate_json(json.dumps(YAML(typ="safe").load(text)), strict=True)


def _below(low: NotNegative, high: NotNegative) -> bool:
    """Whether a number is below its counterpart; lists of other lengths are found elsewhere."""
    a, b = np.atleast_1d(low), np.atleast_1d(high)
    alike = a.size == b.size or 1 in (a.size, b.size)
    return alike and bool(np.any(a < b))
