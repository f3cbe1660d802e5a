"""What stands around the arm: the room, the patient on the table, and the trocar port in the skin."""

import math

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.models.config import RobotConfig, SceneConfig, TrocarConfig, WallConfig
from surgsim.models.graft import asset, graft
from surgsim.models.surfaces import drape_mesh, inward_ellipsoid
from surgsim.spatial import unit

GRAVITY_M_PER_S2 = 9.81
CANNULA_JOINTS = ("cannula_x", "cannula_y", "cannula_z")
_FREE_VIEW_M = np.array([0.5, 0.0, 0.25])  # where the cameras look when there is no trocar, from the base
_PEDESTAL = "pedestal"  # begins the names of its geoms in the room's file
_TUBE_INNER_SHARE = 0.88  # inner radius of the mesh `tube` before scaling


def room_spec(config: SceneConfig) -> mujoco.MjSpec:
    """Floor, pedestal, lamp and the cameras `overview` and `port_closeup`, turned towards the trocar."""
    spec = asset("theatre/room.xml")
    base = np.array(config.robot.base_position_m)
    spec.frame("room").pos = base
    spec.frame("view").pos = _focus(config)
    spec.frame("room").quat = spec.frame("view").quat = about_z(_heading(config))
    return spec


def attach_pedestal(scene: mujoco.MjSpec, robot: RobotConfig) -> None:
    """Stand a further arm's base on a pedestal like that of the room's own."""
    frame = scene.worldbody.add_frame(pos=robot.base_position_m)
    for geom in list(scene.geoms):
        if geom.name.startswith(_PEDESTAL):
            copy = scene.worldbody.add_geom(
                type=geom.type,
                fromto=geom.fromto,
                pos=geom.pos,
                size=geom.size,
                material=geom.material,
                meshname=geom.meshname,
                mass=0.0,
                contype=0,
                conaffinity=0,
                group=geom.group,
            )
            copy.set_frame(frame)


def attach_port(scene: mujoco.MjSpec, trocar: TrocarConfig) -> None:
    """Add the mocap body `port` with site `trocar` at its centre, z out of the patient.

    With a wall the drawn port moves on its own body `cannula`, and `port` is its place of rest.
    """
    spec = asset("trocar/port.xml")
    tube = spec.mesh("tube")
    radius = trocar.bore_diameter_m / 2 / _TUBE_INNER_SHARE
    tube.scale = [radius, radius, tube.scale[2]]
    port = spec.body("port")
    port.pos = trocar.position_m
    port.quat = _z_to(unit(np.array(trocar.axis)))
    if trocar.wall is not None:
        _hang(spec, trocar.wall)
    graft(scene, spec, frame=scene.worldbody.add_frame())


def _hang(spec: mujoco.MjSpec, wall: WallConfig) -> None:
    """Turn the port into the body `cannula` on three springs, and leave an empty mocap body at its place.

    The springs' reference carries the cannula's weight, so that it rests at the configured place.
    """
    cannula = spec.body("port")
    spec.delete(spec.site("trocar"))
    cannula.name, cannula.mocap = "cannula", False
    cannula.mass, cannula.inertia, cannula.explicitinertial = wall.mass_kg, [wall.mass_kg * 1e-4] * 3, True
    cannula.ipos = [0.0, 0.0, 0.0]
    up = np.zeros(3)
    mujoco.mju_rotVecQuat(up, np.array([0.0, 0.0, 1.0]), cannula.quat * (1, -1, -1, -1))
    stiffness = (wall.lateral_stiffness_n_per_m,) * 2 + (wall.axial_stiffness_n_per_m,)
    damping = (wall.lateral_damping_n_s_per_m,) * 2 + (wall.axial_damping_n_s_per_m,)
    for name, axis, k, d, share in zip(CANNULA_JOINTS, np.eye(3), stiffness, damping, up, strict=True):
        joint = cannula.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        joint.stiffness, joint.damping = [k, 0.0, 0.0], [d, 0.0, 0.0]
        joint.springref = wall.mass_kg * GRAVITY_M_PER_S2 * share / k
    rest = spec.worldbody.add_body(name="port", mocap=True, pos=cannula.pos, quat=cannula.quat)
    rest.add_site(name="trocar", group=4)


def attach_patient(scene: mujoco.MjSpec, config: SceneConfig, trocar: TrocarConfig) -> None:
    """Add patient and table so that the abdomen's skin passes through the trocar, normal to its axis."""
    spec = asset("theatre/patient.xml")
    centre, heading = patient_place(config, trocar, np.array(spec.geom("abdomen").size))
    patient = spec.body("patient")
    patient.pos, patient.quat = centre, about_z(heading)
    floor = config.robot.base_position_m[2] + float(scene.geom("floor").pos[2])
    _cover(spec)
    _stand_on(spec, floor - float(centre[2]))
    graft(scene, spec, frame=scene.worldbody.add_frame())


def patient_place(config: SceneConfig, trocar: TrocarConfig, abdomen: Array) -> tuple[Array, float]:
    """Centre (3,) [m] of the abdomen with these semi-axes (3,) [m], and its turn about the vertical [rad].

    Unless the config says where it lies, its skin passes through the trocar, normal to its axis.
    """
    if config.patient is not None:
        return np.array(config.patient.position_m), config.patient.yaw_rad
    heading = _heading(config)
    axis = _rotated(unit(np.array(trocar.axis)), -heading)
    skin = _ellipsoid_point(abdomen, axis)
    return np.array(trocar.position_m) - _rotated(skin, heading), heading


def _cover(spec: mujoco.MjSpec) -> None:
    """Fill in the meshes `drape` and `lining`, which follow the abdomen's size."""
    abdomen = np.array(spec.geom("abdomen").size)
    surfaces = {"drape": drape_mesh(abdomen), "lining": inward_ellipsoid(abdomen - 0.002)}
    for name, (vertices, faces) in surfaces.items():
        mesh = spec.mesh(name)
        mesh.uservert, mesh.userface = vertices.ravel(), faces.ravel()


def _stand_on(spec: mujoco.MjSpec, floor: float) -> None:
    """Put the table's foot on the floor (a height in the patient's frame) and its column on the foot."""
    foot, column = spec.geom("foot"), spec.geom("column")
    top = column.pos[2] + column.size[2]
    bottom = min(floor + 2 * foot.size[2], top - 0.02)
    foot.pos = [*foot.pos[:2], bottom - foot.size[2]]
    column.pos = [*column.pos[:2], (top + bottom) / 2]
    column.size = [*column.size[:2], (top - bottom) / 2]


def _ellipsoid_point(semi_axes: Array, normal: Array) -> Array:
    """Point of an ellipsoid about the origin whose outward unit normal is `normal`: A²n / sqrt(nᵀA²n)."""
    stretched = semi_axes**2 * normal
    return stretched / math.sqrt(float(normal @ stretched))


def _focus(config: SceneConfig) -> Array:
    if config.trocar is not None:
        return np.array(config.trocar.position_m)
    return np.array(config.robot.base_position_m) + _rotated(_FREE_VIEW_M, config.robot.base_yaw_rad)


def _heading(config: SceneConfig) -> float:
    """Angle about z of the horizontal direction from the robot's base to the focus [rad]."""
    away = _focus(config) - np.array(config.robot.base_position_m)
    return math.atan2(away[1], away[0])


def _rotated(vector: Array, angle: float) -> Array:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1], vector[2]])


def about_z(angle: float) -> Array:
    """Quaternion (wxyz) of a turn by `angle` [rad] about z."""
    return np.array([math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)])


def _z_to(direction: Array) -> Array:
    """Quaternion (wxyz) of the shortest turn of the z axis to the unit vector `direction`."""
    quat = np.zeros(4)
    mujoco.mju_quatZ2Vec(quat, direction)
    return quat
