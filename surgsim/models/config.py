"""What a scene is made of."""

import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import (
    AfterValidator,
    Field,
    FiniteFloat,
    NonNegativeFloat,
    PositiveFloat,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)
from pydantic_core import PydanticCustomError

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.errors import SurgsimError
from surgsim.models.adopted.arm import adopted
from surgsim.models.adopted.config import KINDS as KINDS
from surgsim.models.adopted.config import ArmFileConfig
from surgsim.models.adopted.config import Vec3 as Vec3
from surgsim.models.adopted.file import checked_sha256
from surgsim.models.adopted.problem import AdoptionError
from surgsim.models.adopted.tool import SHAFT_END, Tool, read_tool
from surgsim.models.drive import DriveConfig, real_drive
from surgsim.models.folders import is_shipped, known_robot, robot_file, with_literal_variant
from surgsim.models.instrument_files import (
    instrument_file,
    instrument_origin,
    known_instrument,
    shipped_instruments,
)


@dataclass(frozen=True)
class ForEachJoint:
    """Marks a list of a config that has one item for each joint of the scenario's robot."""


PerJoint = Annotated[tuple[FiniteFloat, ...], ForEachJoint()]
"""A number for each joint, from the base on (n,)."""
RobotName = Annotated[str, AfterValidator(known_robot)]
InstrumentName = Annotated[str, AfterValidator(known_instrument)]


class RobotConfig(ArmFileConfig):
    """Which arm, and where its base stands in the world: a name, or somebody's own file.

    Attributes:
        name: A robot's folder: one that is shipped, on the search path, or of an installed package.
        base_position_m: Of the base in the world [m].
        base_yaw_rad: Turn of the base about the vertical [rad].
        dh_variant: `literal` takes d2 as Table 3 of the manipulability paper prints it, a misprint: for
            studies of that paper and its arm alone.
        drive: `ideal`: the commanded torque acts on the joint. `real`: through motors, elastic gears and
            torque loops as the robot's folder states them; or a mapping of what is to be otherwise.
    """

    name: RobotName | None = None
    base_position_m: Vec3 = (0.0, 0.0, 0.0)
    base_yaw_rad: FiniteFloat = 0.0
    dh_variant: Literal["standard", "literal"] = "standard"
    drive: Literal["ideal", "real"] | DriveConfig = "ideal"

    @model_validator(mode="after")
    def _is_one_arm(self) -> Self:
        if sum(place is not None for place in (self.name, self.mjcf, self.urdf)) != 1:
            raise ValueError("give one of name, mjcf and urdf")
        if self.name is not None:
            keys = OF_FILES if is_shipped(self.name) else OF_FILES[: -len(HASH)]
            strange = [key for key in keys if getattr(self, key) != type(self).model_fields[key].default]
            if strange:
                reason = f"{strange[0]} is for an arm from a file; '{self.name}' has its own"
                raise PydanticCustomError("placed", "{text}", {"text": reason, "at": (strange[0],)})
        if self.dh_variant == "literal" and self.name not in (known := with_literal_variant()):
            raise ValueError(f"dh_variant 'literal' is of '{', '.join(known)}' alone, not of '{self.label}'")
        if self.name is None or not is_shipped(self.name):
            with placed_errors():
                self._read_file()
        if self.drive != "ideal":
            self._complete_drive()
        return self

    def _complete_drive(self) -> None:
        """Fill in what the folder of the robot's file says of its drives."""
        try:
            own = real_drive((self.file[0] if self.name is None else robot_file(self.name)).parent)
            given = DriveConfig() if isinstance(self.drive, str) else self.drive
            object.__setattr__(self, "drive", given.on(own))  # frozen, but still being made
        except ValueError as error:
            raise PydanticCustomError("placed", "{text}", {"text": str(error), "at": ("drive",)}) from error

    @property
    def drives(self) -> DriveConfig | None:
        """Its drives; None where they are ideal."""
        return None if isinstance(self.drive, str) else self.drive

    def _read_file(self) -> None:
        """Fill in the file's whole path and the hash of what it holds, and see that it is an arm."""
        path, kind = self.file if self.name is None else (robot_file(self.name), KINDS[0])
        found = checked_sha256(path, kind, self.files_sha256)
        object.__setattr__(self, "files_sha256", found)  # frozen, but still being made
        if self.name is None:
            object.__setattr__(self, kind, os.path.abspath(path))
            adopted(self)

    @model_serializer(mode="wrap")
    def _without_what_has_no_use(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Of an arm with a name the keys for files say nothing, and of one from a file the other places."""
        every: dict[str, Any] = write(self)
        idle = OF_FILES[: -len(HASH)] if self.name is not None else ("name",)
        optional = (*PLACES, *HASH)
        return {
            key: v for key, v in every.items() if key not in idle and (key not in optional or v is not None)
        }

    @property
    def label(self) -> str:
        """What messages and tables call it: its name, or that of its file."""
        return self.name if self.name is not None else self.file[0].stem


PLACES, HASH = ("name", *KINDS), ("files_sha256",)
OF_FILES = (*(key for key in ArmFileConfig.model_fields if key not in HASH), *HASH)
"""Keys that are for an arm from a file alone; the last one also for a robot's folder that is not shipped."""


@contextmanager
def placed_errors() -> Iterator[None]:
    """Say what is wrong with an arm's file at the key that it is about."""
    try:
        yield
    except AdoptionError as error:
        raise PydanticCustomError("placed", "{text}", {"text": str(error), "at": error.at}) from error


class HolderConfig(PartConfig):
    """A rigid, massless holder between flange and instrument.

    Attributes:
        position_m: Of its end in the flange's frame [m].
        quaternion_wxyz: Of its end in the flange's frame; z is the tool axis.
    """

    position_m: Vec3 = (0.0, 0.0, 0.0)
    quaternion_wxyz: tuple[FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat] = (1.0, 0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _is_a_turn(self) -> Self:
        if not any(self.quaternion_wxyz):
            raise ValueError("quaternion_wxyz must not be zero")
        return self


class InstrumentConfig(PartConfig):
    """Straight rigid laparoscopic shaft on an adapter, along the flange's z axis; or one from a file.

    The shipped shaft's tip is `adapter_length_m + shaft_length_m` from the flange.

    Attributes:
        name: An instrument's file that is shipped, on the search path, or of an installed package.
        mjcf: An MJCF file whose first body is fixed to the flange; lengths, mass and inertia are its own.
        shaft_entry_site: Site of the file at the start of the shaft.
        shaft_end_site: Site of the file at the end of the shaft, which is straight from the one to the other;
            the tip where the file has no `shaft_end`.
        tip_site: Site of the file at the tip.
        files_sha256: Hash of the file and all that it names; filled in, and checked where it is given.
        holder: A rigid holder between flange and instrument.
    """

    name: InstrumentName | None = None
    mjcf: str | None = None
    shaft_entry_site: str = "shaft_entry"
    shaft_end_site: str = SHAFT_END
    tip_site: str = "tip"
    files_sha256: str | None = None
    holder: HolderConfig | None = None
    type: Literal["laparoscopic_straight"] = "laparoscopic_straight"
    shaft_length_m: Annotated[float, Field(gt=0.1, le=0.6)] = 0.40
    shaft_diameter_m: Annotated[float, Field(ge=0.002, le=0.015)] = 0.008
    adapter_length_m: Annotated[float, Field(gt=0.0, le=0.2)] = 0.04
    mass_kg: PositiveFloat = 0.35
    com_m: Annotated[float, Field(gt=0.0, le=0.3)] = 0.10

    @model_validator(mode="after")
    def _is_of_a_file_or_made(self) -> Self:
        if self.name is not None and self.mjcf is not None:
            raise ValueError("give one of name and mjcf")
        hashed = self.mjcf is not None or (self.name is not None and self.name not in shipped_instruments())
        for key in OF_TOOL_FILES if self.mjcf is None else ():
            if getattr(self, key) != type(self).model_fields[key].default and not (key in HASH and hashed):
                raise ValueError(f"{key} is for an instrument from a file: give mjcf")
        if not self.of_file:
            return self._checked_com()
        with placed_errors(), self._told_of_package():
            self._read_file(hashed)
        return self

    @contextmanager
    def _told_of_package(self) -> Iterator[None]:
        """Say which instrument, and of which package, where the file of one with a name is wrong."""
        try:
            yield
        except SurgsimError as error:
            if self.name is None:
                raise
            at = [key for key in getattr(error, "at", ()) if key in (*OF_ROD, *HASH)]
            told = str(error) if str(error).startswith("instrument '") else f"{self._label}: {error}"
            raise AdoptionError(told, *(at or ["name"])) from error

    @property
    def _label(self) -> str:
        origin = "" if self.name is None else instrument_origin(self.name)
        return f"instrument '{self.name}'" + (f" {origin}" if origin else "")

    def _read_file(self, hashed: bool) -> None:
        """Fill in the whole path, the hash, and the lengths that the file has."""
        stated = [key for key in OF_ROD if key in self.model_fields_set]
        if stated:
            raise AdoptionError(f"{stated[0]} is read from the instrument's file: leave it out", stated[0])
        if hashed:
            found = checked_sha256(self._path, "mjcf", self.files_sha256)
            object.__setattr__(self, "files_sha256", found)  # frozen, but still being made
        if self.mjcf is not None:
            object.__setattr__(self, "mjcf", os.path.abspath(self.mjcf))
        for key in ("adapter_length_m", "shaft_length_m"):
            object.__setattr__(self, key, getattr(self.tool, key))

    @model_serializer(mode="wrap")
    def _without_what_has_no_use(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Of the one from a file what it has itself is left out, of the other the keys for files."""
        every: dict[str, Any] = write(self)
        of_file = (*OF_ROD, "type")
        if self.name is not None:
            idle = (*OF_TOOL_FILES[: -len(HASH)], *of_file)
        else:
            idle = ("name", *(OF_TOOL_FILES if self.mjcf is None else of_file))
        optional = ("holder", *HASH)
        return {
            key: v for key, v in every.items() if key not in idle and (key not in optional or v is not None)
        }

    @property
    def of_file(self) -> bool:
        """Whether it is from a file, with a name or without."""
        return self.name is not None or self.mjcf is not None

    @property
    def _path(self) -> Path:
        if self.name is not None:
            return instrument_file(self.name)
        if self.mjcf is None:
            raise ValueError("the instrument is of no file")
        return Path(self.mjcf)

    @property
    def tool(self) -> Tool:
        """What its file holds.

        Raises:
            AdoptionError: If it is no instrument.
            ValueError: If it is of no file.
        """
        sites = (self.shaft_entry_site, self.shaft_end_site, self.tip_site)
        return read_tool(self._path, *sites, self.files_sha256 or "")

    @property
    def p_ST(self) -> Array:
        """The tip from the shaft's end (3,) [m], z along the shaft; zeros of a straight instrument."""
        return self.tool.p_ST.copy() if self.of_file else np.zeros(3)

    def up_to_shaft_end(self) -> "InstrumentConfig":
        """The same with its tip at the shaft's end."""
        return self.model_copy(update={"tip_site": self.shaft_end_site}) if self.p_ST.any() else self

    @property
    def tip_from_shaft_m(self) -> tuple[float, float]:
        """How far the tip is beside the shaft's line, and past the shaft's end along it [m]."""
        x, y, z = self.p_ST
        return math.hypot(x, y), float(z)

    def _checked_com(self) -> Self:
        low, high = 0.5 * self.adapter_length_m, self.adapter_length_m + 0.5 * self.shaft_length_m
        if not low <= self.com_m <= high:
            raise ValueError(
                f"com_m {self.com_m:g} cannot be reached by a uniform adapter and shaft of these lengths: "
                f"it must be from {low:g} to {high:g}"
            )
        return self


OF_TOOL_FILES = ("mjcf", "shaft_entry_site", "shaft_end_site", "tip_site", "files_sha256")
OF_ROD = ("shaft_length_m", "adapter_length_m", "mass_kg", "com_m")
"""Keys of the shipped instrument alone."""


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


class PatientConfig(PartConfig):
    """Where the patient lies.

    Attributes:
        position_m: Of the abdomen's centre [m].
        yaw_rad: Turn of the patient about the vertical [rad].
    """

    position_m: Vec3
    yaw_rad: FiniteFloat = 0.0


class SceneConfig(PartConfig):
    """Everything that is compiled into the MuJoCo model.

    Attributes:
        patient: Where the patient lies; null: so that the skin passes through the trocar, normal to its axis.
        theatre: Whether table, patient, floor and lights are in the scene (visual only).
    """

    robot: RobotConfig
    instrument: InstrumentConfig | None = InstrumentConfig()
    trocar: TrocarConfig | None = None
    patient: PatientConfig | None = None
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
