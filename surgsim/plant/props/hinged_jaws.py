"""Jaws on hinges that hold a ring by friction alone, and a shaft that touches.

They take the place of the instrument's drawn jaws: those of `assets/props/hinged_jaws.xml`. A drive leads
each to

    q_d = open (1 - jaw) - past jaw,     tau = K (q_d - q), cut at tau_max

where `past` is beyond what a rim between them lets through, so that closed jaws press with tau_max. That is
set so that a ring slips out at the force F of `grip_force_n`: two fingers with the friction mu and the lever
l of the rim hold F = 2 mu tau_max / l.

MuJoCo's friction cones are elliptic here, and friction is much stiffer than the contact's normal
(`impratio`): with pyramids a held ring creeps out within two seconds.
"""

import math

import mujoco
import numpy as np

from surgsim.compiled import compiled
from surgsim.errors import SurgsimError
from surgsim.models.build import Scene
from surgsim.models.graft import asset
from surgsim.models.peg_board import PegBoardLayout
from surgsim.plant.props.base import TIP_CONTACT_BIT
from surgsim.plant.props.grasp import NOBODY, sensed
from surgsim.plant.props.peg_scene import ring_name
from surgsim.tick.arrays import Record, World
from surgsim.tick.views import vector

JAWS = ("jaw_left", "jaw_right")
SHAFT = "shaft_contact"
OPEN_RAD = 0.04
_PAST_RAD = 0.05
_STIFFNESS_NM_PER_RAD = 2.0
_LEVER_M = 0.0165  # from a hinge to where its fingers touch a rim
_IMPRATIO = 300.0
_SHAFT_M = (0.12, 0.02)  # where the part of the shaft that touches begins and ends, behind the tip
_STEEL = [0.80, 0.82, 0.85, 1.0]
_TOUCH_N = 0.005
_SURE_S = 0.05
_OPENING = 0.95  # jaws that are told to close by less than this share of what they did are opening
_NET_FORCE = (1 << int(mujoco.mjtConDataField.mjCONDATA_FORCE), 3, 1)  # what a contact sensor gives


class JawsLaw(Record):
    """Numbers of the hinged jaws.

    Attributes:
        close_at: How far closed they can hold.
        open_at: How far closed they have let go.
        torque_nm: Limit of each drive [N m].
        position: Where the left one is in `qpos`; the right one follows.
        dof: The same in `qvel`.
        left: Where the sensors have the left one's force on the first ring; for each ring left, then right.
        shaft: Where they have the force on the shaft.
    """

    close_at: float
    open_at: float
    torque_nm: float
    position: int
    dof: int
    left: int
    shaft: int


class Pinch(Record):
    """What the hinged jaws hold.

    Attributes:
        held: The ring between them, or NOBODY.
        touched: A ring that both touch and that is not said to be held yet, or NOBODY.
        other_s: How long it has been other than `held` says: a held ring not touched by both, or another
            one touched [s].
        tightest: How far closed the jaws were at most since it is held.
    """

    held: int
    touched: int
    other_s: float
    tightest: float


def add_jaws(spec: mujoco.MjSpec, layout: PegBoardLayout, turn_rad: float) -> None:
    """Put the hinged jaws in the place of the drawn ones, let the shaft touch, and measure the forces."""
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = _IMPRATIO
    grasper, jaws = asset("props/hinged_jaws.xml"), spec.body("jaws")
    for geom in list(jaws.geoms):
        if geom.type == mujoco.mjtGeom.mjGEOM_MESH:
            spec.delete(geom)
    tip = grasper.site("tip").pos
    half = 0.5 * turn_rad
    frame = jaws.add_frame(pos=-np.array(tip), quat=[math.cos(half), 0.0, 0.0, math.sin(half)])
    for name in JAWS:
        body = frame.attach_body(grasper.body(name), f"{name}_of/", "")
        body.name = body.joints[0].name = name
        for geom in body.geoms:
            geom.material, geom.rgba = "", _STEEL
    _touch_with_shaft(spec)
    for ring in range(len(layout.source_m)):
        for name in JAWS:
            _add_sensor(spec, f"{name}_{ring_name(ring)}", mujoco.mjtObj.mjOBJ_BODY, name, ring_name(ring))
    _add_sensor(spec, SHAFT, mujoco.mjtObj.mjOBJ_GEOM, SHAFT)


def _touch_with_shaft(spec: mujoco.MjSpec) -> None:
    """A capsule along the last part of the shaft.

    Raises:
        SurgsimError: If the instrument has none.
    """
    shaft, tip = spec.geom("shaft"), np.array(spec.body("jaws").pos)
    if shaft is None:
        raise SurgsimError("prop 'peg_board': hold 'friction' is for the shipped straight instrument")
    radius = float(shaft.size[0])
    along = np.array([0.0, 0.0, 1.0])
    spec.body("instrument").add_geom(
        name=SHAFT,
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=[*(tip - _SHAFT_M[0] * along), *(tip - (_SHAFT_M[1] + radius) * along)],
        size=[radius, 0, 0],
        mass=0.0,
        contype=TIP_CONTACT_BIT,
        conaffinity=0,
        group=3,
        material="",
    )


def _add_sensor(spec: mujoco.MjSpec, name: str, kind: mujoco.mjtObj, of: str, other: str = "") -> None:
    """The sum of all contact forces of `of`, with `other` alone where there is one, world frame."""
    against = {"reftype": mujoco.mjtObj.mjOBJ_BODY, "refname": other} if other else {}
    sensor = spec.add_sensor(
        name=name, type=mujoco.mjtSensor.mjSENS_CONTACT, objtype=kind, objname=of, **against
    )
    sensor.intprm[: len(_NET_FORCE)] = _NET_FORCE


def describe_jaws(law: JawsLaw, scene: Scene, grip_force_n: float) -> None:
    """Fill the places in a model and the torque limit.

    Raises:
        SurgsimError: If the model has not the contacts that friction needs.
    """
    model = scene.model
    if model.opt.cone != mujoco.mjtCone.mjCONE_ELLIPTIC:
        raise SurgsimError("prop 'peg_board': hold 'friction' is for one arm; several share one 'weld' model")
    finger = int(model.body_geomadr[model.body(JAWS[0]).id] + model.body_geomnum[model.body(JAWS[0]).id] - 1)
    law.torque_nm = grip_force_n * _LEVER_M / (2.0 * float(model.geom_friction[finger, 0]))
    law.position, law.dof = model.joint(JAWS[0]).qposadr[0], model.joint(JAWS[0]).dofadr[0]
    law.left = model.sensor(f"{JAWS[0]}_{ring_name(0)}").adr[0]
    law.shaft = model.sensor(SHAFT).adr[0]


@compiled
def drive_jaws(law: JawsLaw, world: World) -> None:
    """Torques of the drives."""
    wanted = OPEN_RAD * (1.0 - world.jaw) - _PAST_RAD * world.jaw
    q, torque = vector(world.qpos, world.nq), vector(world.qfrc_applied, world.nv)
    for k in range(2):
        tau = _STIFFNESS_NM_PER_RAD * (wanted - q[law.position + k])
        torque[law.dof + k] += min(max(tau, -law.torque_nm), law.torque_nm)


@compiled
def squeeze(law: JawsLaw, ring: int, world: World) -> float:
    """The smaller of the two jaws' forces on a ring over the last step [N]."""
    left = law.left + 6 * ring
    return min(sensed(world, left), sensed(world, left + 3))


@compiled
def pinch(law: JawsLaw, rings: int, grasp: Pinch, world: World) -> int:
    """See which ring is between the jaws: both touch it; the ring that slipped out, or NOBODY.

    One is held when both have touched it for `_SURE_S`, and has slipped when they have not for as long;
    in jaws that are opening it has been let go.
    """
    if world.jaw < law.open_at:
        grasp.held = grasp.touched = NOBODY
        return NOBODY
    if grasp.held != NOBODY:
        grasp.tightest = max(grasp.tightest, world.jaw)
        touched = squeeze(law, grasp.held, world) > _TOUCH_N
        grasp.other_s = 0.0 if touched else grasp.other_s + world.timestep_s
        if grasp.other_s <= _SURE_S:
            return NOBODY
        slipped = grasp.held if world.jaw >= _OPENING * grasp.tightest else NOBODY
        grasp.held = grasp.touched = NOBODY
        return slipped
    between = NOBODY
    for ring in range(rings):
        if between == NOBODY and squeeze(law, ring, world) > _TOUCH_N:
            between = ring
    grasp.other_s = grasp.other_s + world.timestep_s if between == grasp.touched else 0.0
    grasp.touched = between
    if between != NOBODY and world.jaw >= law.close_at and grasp.other_s > _SURE_S:
        grasp.held, grasp.other_s, grasp.tightest = between, 0.0, world.jaw
    return NOBODY


def open_hinged(scene: Scene, data: mujoco.MjData) -> None:
    """Begin a run with open jaws."""
    for name in JAWS:
        data.qpos[scene.parts.joint(name).qposadr[0]] = OPEN_RAD


def let_go(pinched: Pinch) -> None:
    """Begin a run: nothing is held."""
    pinched.held = pinched.touched = NOBODY
    pinched.other_s = pinched.tightest = 0.0
