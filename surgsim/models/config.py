"""What a scene is made of."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, FiniteFloat, NonNegativeFloat, PositiveFloat, model_validator

from surgsim.catalog import PartConfig
from surgsim.models.robot import known_robot, with_literal_variant

Vec3 = tuple[FiniteFloat, FiniteFloat, FiniteFloat]


@dataclass(frozen=True)
class ForEachJoint:
    """Marks a list of a config that has one item for each joint of the scenario's robot."""


PerJoint = Annotated[tuple[FiniteFloat, ...], ForEachJoint()]
"""A number for each joint, from the base on (n,)."""
RobotName = Annotated[str, AfterValidator(known_robot)]


class RobotConfig(PartConfig):
    """Which arm, and where its base stands in the world.

    Attributes:
        dh_variant: `literal` takes d2 as Table 3 of the manipulability paper prints it, a misprint: for
            studies of that paper and its arm alone.
    """

    name: RobotName
    base_position_m: Vec3 = (0.0, 0.0, 0.0)
    base_yaw_rad: FiniteFloat = 0.0
    dh_variant: Literal["standard", "literal"] = "standard"

    @model_validator(mode="after")
    def _variant_exists(self) -> Self:
        if self.dh_variant == "literal" and self.name not in (known := with_literal_variant()):
            raise ValueError(f"dh_variant 'literal' is of '{', '.join(known)}' alone, not of '{self.name}'")
        return self


class InstrumentConfig(PartConfig):
    """Straight rigid laparoscopic shaft on an adapter, along the flange's z axis.

    The tip is `adapter_length_m + shaft_length_m` from the flange.
    """

    type: Literal["laparoscopic_straight"] = "laparoscopic_straight"
    shaft_length_m: Annotated[float, Field(gt=0.1, le=0.6)] = 0.40
    shaft_diameter_m: Annotated[float, Field(ge=0.002, le=0.015)] = 0.008
    adapter_length_m: Annotated[float, Field(gt=0.0, le=0.2)] = 0.04
    mass_kg: PositiveFloat = 0.35
    com_m: Annotated[float, Field(gt=0.0, le=0.3)] = 0.10

    @model_validator(mode="after")
    def _com_is_possible(self) -> Self:
        low, high = 0.5 * self.adapter_length_m, self.adapter_length_m + 0.5 * self.shaft_length_m
        if not low <= self.com_m <= high:
            raise ValueError(
                f"com_m {self.com_m:g} cannot be reached by a uniform adapter and shaft of these lengths: "
                f"it must be from {low:g} to {high:g}"
            )
        return self


class WallConfig(PartConfig):
    """Compliant abdominal wall that holds the cannula, and the contact of the shaft with the cannula.

    Attributes:
        lateral_stiffness_n_per_m: Of the wall across the port's axis [N/m].
        lateral_damping_n_s_per_m: Of the wall across the axis [N s/m].
        axial_stiffness_n_per_m: Of the wall along the axis [N/m].
        axial_damping_n_s_per_m: Of the wall along the axis [N s/m].
        mass_kg: Cannula and the tissue that moves with it [kg].
        contact_stiffness_n_per_m: Of shaft against bore [N/m].
        contact_damping_n_s_per_m: Of shaft against bore [N s/m].
        seal_friction_n: Dry friction of the seal along the shaft [N].
        seal_stiffness_n_per_m: Of the seal's lip while it sticks [N/m].
        seal_damping_n_s_per_m: Of the seal's lip while it sticks [N s/m].
        tear_force_n: Force of the shaft on the wall past which the incision tears [N].
    """

    lateral_stiffness_n_per_m: PositiveFloat = 1000.0
    lateral_damping_n_s_per_m: NonNegativeFloat = 15.0
    axial_stiffness_n_per_m: PositiveFloat = 1000.0
    axial_damping_n_s_per_m: NonNegativeFloat = 15.0
    mass_kg: PositiveFloat = 0.05
    contact_stiffness_n_per_m: PositiveFloat = 20000.0
    contact_damping_n_s_per_m: NonNegativeFloat = 15.0
    seal_friction_n: NonNegativeFloat = 1.0
    seal_stiffness_n_per_m: PositiveFloat = 20000.0
    seal_damping_n_s_per_m: NonNegativeFloat = 15.0
    tear_force_n: PositiveFloat = 30.0

    def check_timestep(self, timestep_s: float) -> None:
        """Refuse what the timestep cannot follow.

        The cannula's mass m on stiffness k and explicit damping b is stable for k h²/m + 2 b h/m < 4 with
        timestep h; a quarter of that, k h²/m + b h/m <= 1, is asked for.

        Raises:
            ValueError: With the largest timestep allowed.
        """
        lateral = (
            self.lateral_stiffness_n_per_m + self.contact_stiffness_n_per_m,
            self.contact_damping_n_s_per_m,
        )
        axial = (self.axial_stiffness_n_per_m + self.seal_stiffness_n_per_m, self.seal_damping_n_s_per_m)
        longest = min(_longest_step(k, b, self.mass_kg) for k, b in (lateral, axial))
        if timestep_s > longest:
            raise ValueError(
                f"trocar.wall: stiffness and damping of contact and seal need a timestep of at most "
                f"{longest:.3g} s for a cannula of mass_kg {self.mass_kg:g}, not {timestep_s:g} s"
            )


def _longest_step(stiffness: float, damping: float, mass: float) -> float:
    """Positive root h of k h² + b h = m."""
    return float((math.sqrt(damping**2 + 4.0 * stiffness * mass) - damping) / (2.0 * stiffness))


class TrocarConfig(PartConfig):
    """Port in the abdominal wall; `axis` points out of the patient.

    Attributes:
        wall: Compliant wall with contact; null: an ideal point that nothing touches.
    """

    position_m: Vec3
    axis: Vec3 = (0.0, 0.0, 1.0)
    bore_diameter_m: PositiveFloat = 0.0089
    wall: WallConfig | None = None

    @model_validator(mode="after")
    def _axis_is_a_direction(self) -> Self:
        if not any(self.axis):
            raise ValueError("axis must not be zero")
        return self


class SceneConfig(PartConfig):
    """Everything that is compiled into the MuJoCo model.

    Attributes:
        theatre: Whether table, patient, floor and lights are in the scene (visual only).
    """

    robot: RobotConfig
    instrument: InstrumentConfig | None = InstrumentConfig()
    trocar: TrocarConfig | None = None
    theatre: bool = True
    timestep_s: PositiveFloat = 0.001

    @model_validator(mode="after")
    def _wall_is_possible(self) -> Self:
        if self.trocar is None or self.trocar.wall is None:
            return self
        if self.instrument is None:
            raise ValueError("trocar.wall needs an instrument: set instrument, or trocar.wall to null")
        if self.clearance_m <= 0.0:
            raise ValueError(
                f"instrument.shaft_diameter_m {self.instrument.shaft_diameter_m:g} must be below the bore, "
                f"{self.trocar.bore_diameter_m:g}"
            )
        self.trocar.wall.check_timestep(self.timestep_s)
        return self

    @property
    def clearance_m(self) -> float:
        """Half of bore diameter minus shaft diameter [m]; NaN without trocar or instrument."""
        if self.trocar is None or self.instrument is None:
            return math.nan
        return (self.trocar.bore_diameter_m - self.instrument.shaft_diameter_m) / 2.0
