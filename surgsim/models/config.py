"""What a scene is made of."""

from typing import Annotated, Literal, Self

from pydantic import Field, FiniteFloat, PositiveFloat, model_validator

from surgsim.catalog import PartConfig

Vec3 = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
Vec7 = tuple[FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat]
RobotName = Literal["lwr4plus", "panda"]


class RobotConfig(PartConfig):
    """Which arm, and where its base stands in the world.

    Attributes:
        dh_variant: `literal` takes d2 = 0.2 m of the LWR4+ as Table 3 of the manipulability paper prints it,
            a misprint (the arm has 0): for studies of that paper alone.
    """

    name: RobotName
    base_position_m: Vec3 = (0.0, 0.0, 0.0)
    base_yaw_rad: FiniteFloat = 0.0
    dh_variant: Literal["standard", "literal"] = "standard"

    @model_validator(mode="after")
    def _variant_exists(self) -> Self:
        if self.dh_variant == "literal" and self.name != "lwr4plus":
            raise ValueError(f"dh_variant 'literal' is of 'lwr4plus' alone, not of '{self.name}'")
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


class TrocarConfig(PartConfig):
    """Port in the abdominal wall; `axis` points out of the patient."""

    position_m: Vec3
    axis: Vec3 = (0.0, 0.0, 1.0)
    bore_diameter_m: PositiveFloat = 0.0089

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
