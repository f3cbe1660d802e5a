"""Jaws that hold a ring: a constraint in place of the jaws' mechanics.

Closing past `close_at`, the jaws catch the nearest ring if the tip is within `capture_distance_m` of its
rim's surface. A soft weld then keeps the ring's pose relative to the jaws as it is, so that no energy comes
in. The ring slips out in the first step in which the weld's force (its three linear components) exceeds

    F_max = grip_force_n * jaw,

and is let go when the jaws open below `open_at`. What energy the weld holds then is lost. Jaws that closed
on nothing, or lost a ring, must open before they catch again. Held, a ring does not touch the jaws' contact
sphere, nor after that before it has left it.

A weld of MuJoCo's and not a spring written by hand: it is solved together with the contacts, so it is stiff
at a ring of 3 g without a smaller timestep. Its force is not known before a step is done: the limit acts one
step late.
"""

import math

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.models.build import Scene
from surgsim.models.peg_board import PegBoardLayout
from surgsim.plant.props.base import TIP_CONTACT_BIT, TIP_GEOM
from surgsim.plant.props.peg_scene import hold_name, ring_name
from surgsim.tick.algebra import norm, transposed_times
from surgsim.tick.arrays import Record, World
from surgsim.tick.views import body_place, doubles, integers, octets, vector

NOBODY = -1
BODY, WELD, FORCE, FIRST_GEOM, GEOMS, DOF, RING = range(7)
"""Where in a ring's row its numbers are, and its length: body, weld, where the sensors have its hold's force,
first geom and how many, first degree of freedom."""


class GraspLaw(Record):
    """Numbers of the grasp; see the module's text.

    Attributes:
        close_at: How far closed the jaws catch.
        open_at: How far closed they let go.
        capture_distance_m: How near to a rim's surface they catch it [m].
        grip_force_n: Force at which a ring slips out of closed jaws [N].
        ring_radius_m: R of the rim's middle circle [m].
        rim_radius_m: r of the rim [m].
        tip_radius_m: Of the jaws' contact sphere [m].
        jaws: Body of the jaws.
        load: Where the force on the jaws is in the sensors.
        rings: How many there are.
        welds: Constraints of the model.
        weld_size: Numbers of a constraint.
        geoms: Geoms of the model.
        eq_data: Address of the constraints' numbers in MuJoCo's model.
        eq_active: Address of the constraints' states in MuJoCo's data.
        geom_conaffinity: Address of the geoms' contact bits in MuJoCo's model.
    """

    close_at: float
    open_at: float
    capture_distance_m: float
    grip_force_n: float
    ring_radius_m: float
    rim_radius_m: float
    tip_radius_m: float
    jaws: int
    load: int
    rings: int
    welds: int
    weld_size: int
    geoms: int
    eq_data: int
    eq_active: int
    geom_conaffinity: int


class Grasp(Record):
    """The jaws' hold on at most one ring.

    The welds' poses and the rings' contact bits are kept in the model, which belongs to the plant: a run
    begins by letting all rings go.

    Attributes:
        held: The ring in the jaws, or NOBODY.
        leaving: The ring that was let go and may still overlap the contact sphere, or NOBODY.
        ready: Whether the jaws have opened since they closed last.
    """

    held: int
    leaving: int
    ready: int


def describe_grasp(law: GraspLaw, scene: Scene, data: mujoco.MjData, layout: PegBoardLayout) -> Array:
    """Fill the places in a model and its data; answers the rings' rows (k, 6)."""
    model = scene.model
    law.ring_radius_m, law.rim_radius_m = layout.ring_radius_m, layout.rim_radius_m
    law.rings, law.welds, law.geoms = len(layout.source_m), model.neq, model.ngeom
    law.weld_size = model.eq_data.shape[1]
    law.eq_data, law.eq_active = model.eq_data.ctypes.data, data.eq_active.ctypes.data
    law.geom_conaffinity = model.geom_conaffinity.ctypes.data
    rows = np.zeros((len(layout.source_m), RING))
    for ring, row in enumerate(rows):
        body = model.body(ring_name(ring)).id
        row[BODY], row[DOF] = body, model.joint(ring_name(ring)).dofadr[0]
        row[FIRST_GEOM], row[GEOMS] = model.body_geomadr[body], model.body_geomnum[body]
    return rows


def describe_welds(law: GraspLaw, scene: Scene, rows: Array) -> None:
    """Fill the places of the welds and of the jaws' sensor, in the welds' rows of numbers too."""
    model = scene.model
    law.tip_radius_m = model.geom(TIP_GEOM).size[0]
    law.jaws, law.load = model.body("jaws").id, model.sensor("jaws_load").adr[0]
    for ring, row in enumerate(rows):
        hold = hold_name(ring)
        row[WELD], row[FORCE] = model.equality(hold).id, model.sensor(hold).adr[0]


def open_jaws(law: GraspLaw, rings: Array, grasp: Grasp) -> None:
    """Begin a run: nothing is held, and all rings touch the jaws."""
    grasp.held, grasp.leaving, grasp.ready = NOBODY, NOBODY, 1
    for ring in range(len(rings)):
        touch(law, rings, ring, True)


@compiled
def grip(law: GraspLaw, rings: Array, grasp: Grasp, world: World) -> int:
    """Catch, let slip or let go, the jaws closed by `world.jaw`; the ring that slipped, or NOBODY."""
    slipped = NOBODY
    if grasp.leaving != NOBODY and _tip_gap(law, rings, grasp.leaving, world) > 0.0:
        touch(law, rings, grasp.leaving, True)
        grasp.leaving = NOBODY
    if grasp.held != NOBODY:
        slips = hold_force(rings, grasp, world) > law.grip_force_n * world.jaw
        if world.jaw < law.open_at or slips:
            if world.jaw >= law.open_at:
                slipped = grasp.held
            octets(law.eq_active, law.welds)[int(rings[grasp.held, WELD])] = 0
            grasp.leaving, grasp.held = grasp.held, NOBODY
    if world.jaw < law.open_at:
        grasp.ready = 1
    elif world.jaw >= law.close_at and grasp.ready:
        grasp.ready = 0
        _catch(law, rings, grasp, world)
    return slipped


@compiled
def hold_force(rings: Array, grasp: Grasp, world: World) -> float:
    """Force of the jaws on the ring in them over the last step [N]."""
    return 0.0 if grasp.held == NOBODY else sensed(world, int(rings[grasp.held, FORCE]))


@compiled
def sensed(world: World, at: int) -> float:
    """Norm of the force that a sensor measured over the last step [N]."""
    return norm(vector(world.sensordata + 8 * at, 3))


@compiled
def _catch(law: GraspLaw, rings: Array, grasp: Grasp, world: World) -> None:
    """Weld the nearest ring to the jaws if it is within reach."""
    point, nearest, ring = body_place(world, law.jaws), math.inf, 0
    for k in range(law.rings):
        gap = _gap(law, rings, k, point, world)
        if gap < nearest:
            nearest, ring = gap, k
    if nearest > law.capture_distance_m:
        return
    if grasp.leaving != NOBODY:
        touch(law, rings, grasp.leaving, True)
        grasp.leaving = NOBODY
    weld = int(rings[ring, WELD])
    _keep_pose(law, int(rings[ring, BODY]), world, doubles(law.eq_data, law.welds, law.weld_size)[weld])
    octets(law.eq_active, law.welds)[weld] = 1
    touch(law, rings, ring, False)
    grasp.held = ring


@compiled
def _keep_pose(law: GraspLaw, body: int, world: World, out: Array) -> None:
    """The ring's place in the jaws as a weld's numbers.

    The tip in the ring's frame, the tip in the jaws', and the ring's orientation in the jaws' (wxyz).
    """
    quats = doubles(world.xquat, world.nbody, 4)
    a, b = quats[law.jaws], quats[body]
    _within(body, body_place(world, law.jaws), world, out[:3])
    for i in range(3):
        out[3 + i] = 0.0
    out[6] = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
    out[7] = a[0] * b[1] - a[1] * b[0] - a[2] * b[3] + a[3] * b[2]
    out[8] = a[0] * b[2] + a[1] * b[3] - a[2] * b[0] - a[3] * b[1]
    out[9] = a[0] * b[3] - a[1] * b[2] + a[2] * b[1] - a[3] * b[0]


@compiled
def _within(body: int, point: Array, world: World, out: Array) -> None:
    """A point (3,) [m] in a body's frame."""
    place, away = body_place(world, body), np.empty(3)
    for i in range(3):
        away[i] = point[i] - place[i]
    transposed_times(doubles(world.xmat + 72 * body, 3, 3), away, out)


@compiled
def _gap(law: GraspLaw, rings: Array, ring: int, point: Array, world: World) -> float:
    """Distance [m] of a point (3,) from the surface of a ring: of a circle, less the rim's radius."""
    p = np.empty(3)
    _within(int(rings[ring, BODY]), point, world, p)
    across = math.sqrt(p[0] * p[0] + p[1] * p[1]) - law.ring_radius_m
    return math.sqrt(across * across + p[2] * p[2]) - law.rim_radius_m


@compiled
def _tip_gap(law: GraspLaw, rings: Array, ring: int, world: World) -> float:
    """Room between the jaws' contact sphere and a ring [m]."""
    place, turn, centre = body_place(world, law.jaws), doubles(world.xmat + 72 * law.jaws, 3, 3), np.empty(3)
    for i in range(3):
        centre[i] = place[i] - law.tip_radius_m * turn[i, 2]
    return _gap(law, rings, ring, centre, world) - law.tip_radius_m


@compiled
def touch(law: GraspLaw, rings: Array, ring: int, touching: bool) -> None:
    """Whether a ring's rim touches the jaws' contact sphere."""
    bits, first = integers(law.geom_conaffinity, law.geoms), int(rings[ring, FIRST_GEOM])
    for geom in range(first, first + int(rings[ring, GEOMS])):
        if bits[geom] != 0:
            bits[geom] = bits[geom] | TIP_CONTACT_BIT if touching else bits[geom] & ~TIP_CONTACT_BIT
