"""Composition of a scene from its config, and the names in it resolved to ids once."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

from surgsim.array import Array
from surgsim.errors import SurgsimError
from surgsim.models.adopted.tool import SHAFT_END
from surgsim.models.collision import CollisionShapes, collision_shapes
from surgsim.models.config import RobotConfig, SceneConfig, WallConfig
from surgsim.models.drive import DriveConfig
from surgsim.models.graft import graft
from surgsim.models.instrument import attach_instrument
from surgsim.models.named import Named, prefix_of
from surgsim.models.robot import JointLimits, home_of, joint_names, motor_names, robot_spec
from surgsim.models.theatre import (
    CANNULA_JOINTS,
    GRAVITY_M_PER_S2,
    about_z,
    attach_patient,
    attach_pedestal,
    attach_port,
    room_spec,
)

__all__ = ["JointLimits", "Scene", "SharedArm", "SpecModifier", "build", "build_arm", "build_shared"]

Ids = NDArray[np.intp]


class SpecModifier(Protocol):
    """Changes the scene before it is compiled: an unknown payload, friction, wrong inertia."""

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Change `spec` in place."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """A compiled model and the ids of an arm in it. The model must not be changed.

    Several arms may share a model, each with a scene of its own.

    Attributes:
        model: The compiled MuJoCo model.
        qpos_ids: Where the arm's positions are in `qpos` (n,).
        dof_ids: Where its velocities are in `qvel` (n,).
        actuator_ids: Where its motors are in `ctrl` (n,).
        flange_site: Flange, z along the tool.
        tip_site: Instrument tip, z along the shaft; the flange without an instrument.
        shaft_entry_site: Start of the shaft, a point of its axis; the wrist without an instrument.
        shaft_end_site: End of the shaft, a second point of its axis, z along it; the tip if it is not angled.
        trocar_site: Remote centre of motion, z out of the patient.
        port_mocap: Row of the port in `mocap_pos`.
        wall: The compliant wall; None if the trocar is an ideal point.
        clearance_m: Half of bore diameter minus shaft diameter [m]; NaN without trocar or instrument.
        cannula_qpos_ids: Where the cannula's displacement, in the port's frame, is in `qpos` (3,); (0,)
            without a wall.
        cannula_dof_ids: Where its velocity is in `qvel` (3,); (0,) without a wall.
        limits: What the joints can do.
        home: The arm's own home posture (n,) [rad]; None where it has none.
        shapes: Where forbidden contacts are looked for.
        prefix: What stands before the arm's names in the model; empty where there is one arm.
    """

    model: mujoco.MjModel
    qpos_ids: Ids
    dof_ids: Ids
    actuator_ids: Ids
    flange_site: int
    tip_site: int
    shaft_entry_site: int
    shaft_end_site: int
    trocar_site: int | None
    port_mocap: int | None
    wall: WallConfig | None
    clearance_m: float
    cannula_qpos_ids: Ids
    cannula_dof_ids: Ids
    limits: JointLimits
    home: Array | None
    shapes: CollisionShapes
    prefix: str = ""

    @property
    def is_angled(self) -> bool:
        """Whether the instrument's tip is not the shaft's end."""
        return self.shaft_end_site != self.tip_site

    @property
    def parts(self) -> Named:
        """What belongs to the arm, by its own names."""
        return Named(self.model, self.prefix)


@dataclass(frozen=True, kw_only=True)
class SharedArm:
    """An arm of a scene that several share.

    Attributes:
        name: What it is called.
        config: Of the arm, with its instrument and its port.
        modifiers: Applied in order to it before it is put into the scene; they know its own names alone.
    """

    name: str
    config: SceneConfig
    modifiers: Sequence[SpecModifier] = ()


def build(config: SceneConfig, modifiers: Sequence[SpecModifier] = (), *, drawn: bool = True) -> Scene:
    """The whole scene: arm, instrument, port and, if wanted, the theatre.

    Args:
        config: What is in the scene.
        modifiers: Applied in order to the whole composition before it is compiled.
        drawn: False leaves out what is only looked at; the mechanics are the same and step faster.

    Raises:
        SurgsimError: If the robot is unknown or the instrument's parameters contradict each other.
    """
    theatre = config.theatre and drawn
    spec = room_spec(config) if theatre else mujoco.MjSpec()
    spec.compiler.discardvisual = not drawn
    _add_arm(spec, config)
    if config.trocar is not None:
        attach_port(spec, config.trocar)
        if theatre:
            attach_patient(spec, config, config.trocar)
    for modifier in modifiers:
        modifier.modify(spec)
    return _scene(spec.compile(), config)


def build_shared(arms: Sequence[SharedArm], *, drawn: bool = True) -> tuple[Scene, ...]:
    """One model with several arms in one room, around one patient: a scene for each of them.

    Args:
        arms: The arms; the room is that of the first.
        drawn: False leaves out what is only looked at; the mechanics are the same and step faster.

    Raises:
        SurgsimError: As `build`.
    """
    first = arms[0].config
    theatre = first.theatre and drawn
    spec = room_spec(first) if theatre else mujoco.MjSpec()
    spec.compiler.discardvisual = not drawn
    _set_options(spec, first)
    for arm in arms:
        own = mujoco.MjSpec()
        own.compiler.discardvisual = not drawn
        _add_arm(own, arm.config)
        if arm.config.trocar is not None:
            attach_port(own, arm.config.trocar)
        for modifier in arm.modifiers:
            modifier.modify(own)
        spec.attach(own, prefix=prefix_of(arm.name), frame=spec.worldbody.add_frame())
    if theatre:
        for arm in arms[1:]:
            attach_pedestal(spec, arm.config.robot)
        host = next((arm.config for arm in arms if arm.config.trocar is not None), None)
        if host is not None and host.trocar is not None:
            attach_patient(spec, host, host.trocar)
    model = spec.compile()
    return tuple(_scene(model, arm.config, prefix_of(arm.name)) for arm in arms)


@lru_cache(maxsize=16)
def build_arm(config: SceneConfig) -> Scene:
    """Robot and instrument alone, without drawings: the controller's nominal model.

    Compiled once for the runs of a batch.

    Raises:
        SurgsimError: As `build`.
    """
    spec = mujoco.MjSpec()
    spec.compiler.discardvisual = True
    _add_arm(spec, config)
    if config.robot.drives is not None:
        _appear(spec, config.robot.drives)
    return _scene(spec.compile(), config.model_copy(update={"trocar": None}))


def _appear(spec: mujoco.MjSpec, drives: DriveConfig) -> None:
    """The joints' armature is the inertia with which the torque loops let the motors appear."""
    names = joint_names(spec)
    for name, inertia in zip(names, drives.values(len(names)).apparent_inertia, strict=True):
        spec.joint(name).armature = inertia


def _set_options(spec: mujoco.MjSpec, config: SceneConfig) -> None:
    spec.option.timestep = config.timestep_s
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # divergence must be seen
    spec.option.gravity = [0.0, 0.0, -GRAVITY_M_PER_S2]


def _add_arm(spec: mujoco.MjSpec, config: SceneConfig) -> None:
    _set_options(spec, config)
    drawn = not spec.compiler.discardvisual
    arm = robot_spec(config.robot, drawn=drawn)
    attach_instrument(arm, config.instrument)
    graft(spec, arm, frame=_base_frame(spec, config.robot))


def _base_frame(spec: mujoco.MjSpec, robot: RobotConfig) -> mujoco.MjsFrame:
    return spec.worldbody.add_frame(pos=robot.base_position_m, quat=about_z(robot.base_yaw_rad))


def _scene(model: mujoco.MjModel, config: SceneConfig, prefix: str = "") -> Scene:
    """What of the compiled `model` is the arm's whose names begin with `prefix`."""
    parts = Named(model, prefix)
    wall = None if config.trocar is None else config.trocar.wall
    slides = [] if wall is None else [parts.joint(name) for name in CANNULA_JOINTS]
    joints = [parts.joint(name) for name in joint_names(parts)]
    port = parts.find(mujoco.mjtObj.mjOBJ_BODY, "port")
    end = parts.find(mujoco.mjtObj.mjOBJ_SITE, SHAFT_END)
    return Scene(
        model=model,
        qpos_ids=_ids([joint.qposadr[0] for joint in joints]),
        dof_ids=_ids([joint.dofadr[0] for joint in joints]),
        actuator_ids=_ids([parts.actuator(name).id for name in motor_names(len(joints))]),
        flange_site=parts.site("flange").id,
        tip_site=parts.site("tip").id,
        shaft_entry_site=parts.site("shaft_entry").id,
        shaft_end_site=parts.site("tip" if end < 0 else SHAFT_END).id,
        trocar_site=parts.site("trocar").id if port >= 0 else None,
        port_mocap=int(model.body_mocapid[port]) if port >= 0 else None,
        wall=wall,
        clearance_m=config.clearance_m,
        cannula_qpos_ids=_ids([slide.qposadr[0] for slide in slides]),
        cannula_dof_ids=_ids([slide.dofadr[0] for slide in slides]),
        limits=JointLimits.of(parts),
        home=home_of(parts),
        shapes=collision_shapes(parts, config),
        prefix=prefix,
    )


def _ids(values: list[int]) -> Ids:
    ids = np.array(values, dtype=np.intp)
    ids.flags.writeable = False
    return ids


def body_at_flange(scene: Scene) -> int:
    """The body that is mounted on the flange: the instrument, or the holder that bears it.

    Raises:
        SurgsimError: If there is no instrument.
    """
    model = scene.model
    flange, body = int(model.site_bodyid[scene.flange_site]), int(model.site_bodyid[scene.tip_site])
    while body > 0 and model.body_parentid[body] != flange:
        body = int(model.body_parentid[body])
    if body == 0:
        raise SurgsimError("there is no instrument at the flange")
    return body


def span(ids: NDArray[np.intp]) -> slice:
    """Ids that follow each other, as a slice: MuJoCo's arrays are then seen without a copy.

    Raises:
        ValueError: If they do not.
    """
    first = int(ids[0])
    if not np.array_equal(ids, np.arange(first, first + len(ids))):
        raise ValueError(f"the ids {ids} do not follow each other")
    return slice(first, first + len(ids))
