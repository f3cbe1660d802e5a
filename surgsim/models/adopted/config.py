"""What a person says about an arm's file."""

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, FiniteFloat, NonNegativeFloat, PositiveFloat, model_validator

from surgsim.catalog import PartConfig
from surgsim.models.adopted.file import Kind

Vec3 = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
KINDS: tuple[Kind, ...] = ("mjcf", "urdf")


class FlangeConfig(PartConfig):
    """Where the tool is fixed in an arm's file; z is the tool axis.

    Attributes:
        site: A site of the file.
        body: Or a body of the file.
        position_m: Of the flange in the body's frame [m].
        quaternion_wxyz: Of the flange in the body's frame.
    """

    site: str | None = None
    body: str | None = None
    position_m: Vec3 = (0.0, 0.0, 0.0)
    quaternion_wxyz: tuple[FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat] = (1.0, 0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _is_one_place(self) -> Self:
        if (self.site is None) == (self.body is None):
            raise ValueError("give a site or a body")
        moved = self.position_m != (0.0, 0.0, 0.0) or self.quaternion_wxyz != (1.0, 0.0, 0.0, 0.0)
        if self.site is not None and moved:
            raise ValueError("position_m and quaternion_wxyz are in a body's frame: give a body")
        if not any(self.quaternion_wxyz):
            raise ValueError("quaternion_wxyz must not be zero")
        return self


class LimitsConfig(PartConfig):
    """What the joints of an arm from a file can do, each list with a number for each joint; null: the file's.

    Attributes:
        velocity_rad_per_s: Largest speeds [rad/s].
        acceleration_rad_per_s2: Largest accelerations [rad/s^2].
        torque_nm: Largest torques [N m].
    """

    velocity_rad_per_s: tuple[Positive, ...] | None = None
    acceleration_rad_per_s2: tuple[Positive, ...] | None = None
    torque_nm: tuple[Positive, ...] | None = None


class CapsuleConfig(PartConfig):
    """Where collisions of an arm from a file are looked for.

    Attributes:
        body: A body of the file.
        from_m: One end of the axis in the body's frame [m].
        to_m: The other end [m].
        radius_m: [m].
    """

    body: str
    from_m: Vec3
    to_m: Vec3
    radius_m: PositiveFloat


class ArmFileConfig(PartConfig):
    """An arm's file, and what is said about it.

    Attributes:
        mjcf: An MJCF file.
        urdf: Or a URDF file.
        base_body: Body of the file that the base is; null: the root of the arm.
        joints: Joints of the file, from the base on; null: all from the base to the flange.
        flange: Where the tool is fixed: a site, else a body of that name, or a place; null: the file's site
            or body `flange`, `attachment_site` or `tool0`.
        home_rad: A posture to prefer [rad]; null: the file's keyframe `home`.
        limits: Limits that the file lacks, or that count before its own.
        armature_kg_m2: Inertia of each motor as its joint feels it [kg m^2]; null: the file's. Files often
            have none, and joints of the wrist are then lighter than any real one.
        collision: `auto` fits capsules to the file's shapes; or a list of capsules.
        files_sha256: Hash of the file and all that it names, of a robot's folder that is not shipped too;
            filled in, and checked where it is given.
    """

    mjcf: str | None = None
    urdf: str | None = None
    base_body: str | None = None
    joints: tuple[str, ...] | None = None
    flange: FlangeConfig | str | None = None
    home_rad: tuple[FiniteFloat, ...] | None = None
    limits: LimitsConfig = LimitsConfig()
    armature_kg_m2: tuple[NonNegativeFloat, ...] | None = None
    collision: Literal["auto"] | tuple[CapsuleConfig, ...] = "auto"
    files_sha256: str | None = None

    @property
    def file(self) -> tuple[Path, Kind]:
        """The arm's file, and which language it is in.

        Raises:
            ValueError: If none is given.
        """
        if self.mjcf is not None:
            return Path(self.mjcf), "mjcf"
        if self.urdf is not None:
            return Path(self.urdf), "urdf"
        raise ValueError("no file is given")

    @property
    def listed_capsules(self) -> tuple[CapsuleConfig, ...]:
        """The capsules that are given; none with `auto`."""
        return () if isinstance(self.collision, str) else self.collision
