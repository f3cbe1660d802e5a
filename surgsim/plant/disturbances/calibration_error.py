"""An arm and an instrument whose geometry is not that of the controller's model."""

from dataclasses import dataclass
from typing import Annotated, Literal

import mujoco
import numpy as np
from pydantic import Field

from surgsim.array import Array
from surgsim.models.build import Scene
from surgsim.models.displace import about, displace, rotation, with_quaternions
from surgsim.models.robot import joint_names, link_names
from surgsim.plant.disturbances.base import Disturbance, DisturbanceConfig, copied
from surgsim.plant.disturbances.settling import settle_cannula
from surgsim.spatial import unit

LengthStd = Annotated[float, Field(ge=0.0, le=0.05)]
AngleStd = Annotated[float, Field(ge=0.0, le=0.1)]


class CalibrationErrorConfig(DisturbanceConfig):
    """Standard deviations of the geometry's errors, of each coordinate alone; 0: none.

    The defaults are assumed. They leave about 2 mm at the tip: between the 10 mm of an arm as it comes and
    the 0.2 mm of one whose whole geometry was identified (arXiv 2503.12584). 0.5 mm a coordinate of the tool
    is what a pivot calibration leaves, 0.5 to 1 mm.

    Attributes:
        joint_offset_rad: True joint position minus the encoder's [rad].
        link_position_m: Place of each link's frame in that of its parent [m].
        link_angle_rad: Rotation vector of each link's frame in that of its parent [rad].
        base_position_m: Place of the base in the world [m].
        base_angle_rad: Rotation vector of the base in the world [rad].
        tool_tip_m: Place of the instrument, and so of its tip, in the flange's frame [m].
        tool_angle_rad: Of the shaft's axis about the shaft's entry, in the two directions across it [rad].
    """

    type: Literal["calibration_error"] = "calibration_error"
    joint_offset_rad: AngleStd = 5e-4
    link_position_m: LengthStd = 3e-4
    link_angle_rad: AngleStd = 3e-4
    base_position_m: LengthStd = 0.0
    base_angle_rad: AngleStd = 0.0
    tool_tip_m: LengthStd = 5e-4
    tool_angle_rad: AngleStd = 5e-4

    def build(self, rng: np.random.Generator) -> "CalibrationError":
        """The disturbance, which draws the errors once the number of joints is known."""
        return CalibrationError(self, rng)


@dataclass(frozen=True, kw_only=True, eq=False)
class GeometryErrors:
    """What was drawn for an arm of n joints.

    Attributes:
        base_position: (3,) [m].
        base_angle: (3,) [rad].
        tool_tip: (3,) [m].
        tool_angle: (2,) [rad].
        link_position: (n, 3) [m].
        link_angle: (n, 3) [rad].
        joint_offset: (n,) [rad].
    """

    base_position: Array
    base_angle: Array
    tool_tip: Array
    tool_angle: Array
    link_position: Array
    link_angle: Array
    joint_offset: Array


class CalibrationError(Disturbance):
    """Displaces the plant's bodies before the model is compiled; the controller's model stays nominal.

        T_WB     = T_WB,nom     D(d_B, φ_B)
        T_k-1,k  = T_k-1,k,nom  D(d_k, φ_k)  R(z_k, δ_k)  R(z_k, q_k)
        T_ET     = T_EI,nom     D(d_T, 0)  R(entry; φ_x, φ_y, 0)  T_IT

    Frames: base B, link k = 1..n with that of the base as link 0, flange E, instrument I, tip T.

    Notation: D(d, φ) is the translation d after the rotation exp([φ]x); R(z_k, angle) a turn about the axis
    of joint k, at its anchor; R(entry; φ) one about the shaft's entry. Errors are in the displaced frame's
    own axes. q_k is what the encoder reads, and joint ranges are of it: the joint's true angle is q_k + δ_k.

    Whatever a body carries goes with it: inertia, shapes for collisions, sites of shaft and tip. The shaft
    stays straight. Without an instrument there is no tool to err.

    The arm starts at the joint positions of the nominal model, so tip and shaft start beside their places.
    Where a wall holds the cannula, it starts at rest around the shaft (`settle_cannula`).
    """

    def __init__(self, config: CalibrationErrorConfig, rng: np.random.Generator) -> None:
        self._c = config
        self._rng = rng

    def errors(self, n: int) -> GeometryErrors:
        """The errors of an arm of n joints; the same at every call.

        One that is off takes its draws too, so that it changes none of the others.
        """
        c, normal = self._c, copied(self._rng).standard_normal
        return GeometryErrors(
            base_position=c.base_position_m * normal(3),
            base_angle=c.base_angle_rad * normal(3),
            tool_tip=c.tool_tip_m * normal(3),
            tool_angle=c.tool_angle_rad * normal(2),
            link_position=c.link_position_m * normal((n, 3)),
            link_angle=c.link_angle_rad * normal((n, 3)),
            joint_offset=c.joint_offset_rad * normal(n),
        )

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Displace base, links and instrument."""
        joints = joint_names(spec)
        links = link_names(len(joints))
        e = self.errors(len(joints))
        with_quaternions(spec, ("base", *links))
        displace(spec.body("base"), e.base_position, rotation(e.base_angle))
        for k, (link, name) in enumerate(zip(links, joints, strict=True)):
            body, joint = spec.body(link), spec.joint(name)
            displace(body, e.link_position[k], rotation(e.link_angle[k]))
            displace(body, *about(np.array(joint.pos), e.joint_offset[k] * unit(np.array(joint.axis))))
        tool = spec.body("instrument")
        if tool is not None:
            entry = np.array(spec.site("shaft_entry").pos)
            displace(tool, e.tool_tip, rotation(np.zeros(3)))
            displace(tool, *about(entry, np.append(e.tool_angle, 0.0)))

    def start(self, scene: Scene, data: mujoco.MjData, rng: np.random.Generator, dt_s: float) -> None:
        """Let the cannula begin at rest around the shaft."""
        settle_cannula(scene, data)
