"""Looks for contacts that must not be: of the arm with itself, with the patient and with the table."""

import math
from typing import TYPE_CHECKING, Any, ClassVar

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.models.build import Scene
from surgsim.plant.truth import Contact
from surgsim.spatial import segment_distance_squared
from surgsim.tick.arrays import Record, World, new
from surgsim.tick.scratch import scratch
from surgsim.tick.views import doubles, vector, words

if TYPE_CHECKING:
    from surgsim.plant.between import Between


SKIN_MARGIN_M = 0.1
"""How far from the port the shaft may pass the skin; nearer is the RCM limit's matter."""
NOTHING, _BODY, _TABLE, _SKIN = -9, -1, -2, -3
INEXACT_M = 1e-4
"""More than what rounding and the ternary search leave open in a distance."""
_TERNARY_STEPS = 24


class Watch(Record):
    """What is watched, and how much room there was when all of it was last looked at.

    Attributes:
        xpos: Address of the body places.
        xmat: Of the body orientations.
        bodies: Of the bodies that the capsules are fixed to.
        local: Of their end points in the body's frame (count, 2, 3) [m].
        radii: Of their radii [m].
        pairs: Of the capsules that can touch each other (pair_count, 2).
        ends: Of the end points, world frame or the patient's (count, 2, 3) [m]; filled.
        nbody: Bodies.
        count: Capsules.
        pair_count: Pairs.
        shaft: The shaft's capsule, or -1; what follows it is in the patient with it.
        has_patient: 1 with a port, else 0.
        clearance: Room at the last look [m]: nothing touches until so much of it is used up.
        patient: Rows of the patient's and the table's numbers (5, 3).
        q: Joint positions at the last look (n,) [rad].
        p_WC: Port at the last look (3,) [m].
        reach: For each joint how far from its axis a capsule can be (n,) [m].
    """

    SHAPES: ClassVar[dict[str, str]] = {"patient": "5 3", "q": "n", "p_WC": "3", "reach": "n"}
    ADDRESSES: ClassVar[frozenset[str]] = frozenset(
        ("xpos", "xmat", "bodies", "local", "radii", "pairs", "ends")
    )
    xpos: int
    xmat: int
    bodies: int
    local: int
    radii: int
    pairs: int
    ends: int
    nbody: int
    count: int
    pair_count: int
    shaft: int
    has_patient: int
    clearance: float
    patient: Array
    q: Array
    p_WC: Array
    reach: Array


class ContactWatch:
    """Distances between the collision shapes where the bodies now are; nothing is pushed apart.

    Attributes:
        record: What the kernels `is_clear` and `forbidden_contact` work on.
    """

    def __init__(self, scene: Scene, data: mujoco.MjData) -> None:
        s = scene.shapes
        self._names = s.names
        self._kept: dict[str, Any] = {
            "xpos": data.xpos,
            "xmat": data.xmat,
            "bodies": np.array(s.bodies, dtype=np.int64),
            "local": np.array(s.ends, dtype=float),
            "radii": np.array(s.radii, dtype=float),
            "pairs": np.array(s.pairs, dtype=np.int64),
            "ends": np.zeros((len(s.bodies), 2, 3)),
        }
        self.record = w = new(Watch, len(scene.dof_ids))
        for name, array in self._kept.items():
            w[name] = array.ctypes.data
        w.nbody, w.count, w.pair_count, w.shaft = scene.model.nbody, len(s.bodies), len(s.pairs), s.shaft
        w.has_patient = len(s.patient) > 0
        if w.has_patient:
            w.patient[:] = s.patient
        w.reach[:] = reaches(scene)

    def look(self, p_WC: Array) -> Contact | None:
        """The first forbidden contact found, or None.

        Args:
            p_WC: Port (3,) [m], which patient and table move with; not used without one.
        """
        a, b, depth, _ = forbidden_contact(self.record, p_WC)
        return None if b == NOTHING else self._contact(a, b, 1e3 * depth)

    def _contact(self, a: int, b: int, depth_mm: float) -> Contact:
        name = self._names[a]
        if b == _SKIN:
            return Contact(
                detail=f"{name} passes the skin {depth_mm:.1f} mm from the port", with_patient=True
            )
        other = {_BODY: "the patient", _TABLE: "the table"}.get(b) or self._names[b]
        return Contact(detail=f"{name} touches {other}, {depth_mm:.1f} mm deep", with_patient=b < 0)


def reaches(scene: Scene) -> Array:
    """For each joint a bound of the distance from its axis to any capsule (n,) [m], in all postures."""
    model, shapes = scene.model, scene.shapes
    reach = np.zeros(len(scene.dof_ids))
    for k, dof in enumerate(scene.dof_ids):
        joint = int(model.dof_jntid[dof])
        if model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_HINGE:
            return np.full(len(scene.dof_ids), np.inf)
        for body, ends in zip(shapes.bodies, shapes.ends, strict=True):
            far = float(np.linalg.norm(ends, axis=1).max())
            while body not in (0, model.jnt_bodyid[joint]):
                far += float(np.linalg.norm(model.body_pos[body])) + 2.0 * _off_origin(model, body)
                body = model.body_parentid[body]
            if body != 0:
                reach[k] = max(reach[k], far + 2.0 * _off_origin(model, body))
    return reach


def _off_origin(model: mujoco.MjModel, body: int) -> float:
    """How far from the body's origin its joints are [m]."""
    first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
    return float(np.linalg.norm(model.jnt_pos[first : first + count], axis=1).sum()) if count else 0.0


@compiled
def is_clear(watch: Watch, world: World) -> bool:
    """Whether there is no forbidden contact.

    A point of the arm moves by at most sum_i L_i |dq_i|, with the reaches L. All is looked at again only when
    the room that there was could be used up: two capsules may have moved towards each other, and the port
    too. The shaft's place in the skin can change at once, and is looked at every time.
    """
    moved = 0.0
    for i in range(world.q.size):
        moved += watch.reach[i] * abs(world.q[i] - watch.q[i])
    used = 2.0 * moved
    if watch.has_patient:
        used += math.sqrt(
            (world.p_WC[0] - watch.p_WC[0]) ** 2
            + (world.p_WC[1] - watch.p_WC[1]) ** 2
            + (world.p_WC[2] - watch.p_WC[2]) ** 2
        )
    if not used < watch.clearance:
        _, other, _, room = forbidden_contact(watch, world.p_WC)
        watch.clearance = room - INEXACT_M
        for i in range(world.q.size):
            watch.q[i] = world.q[i]
        for i in range(3):
            watch.p_WC[i] = world.p_WC[i]
        return other == NOTHING
    if not watch.has_patient or watch.shaft < 0:
        return True
    ends = doubles(watch.ends, 2 * watch.count, 3)
    for i in range(watch.shaft, watch.count):
        _place(watch, i, ends)
        _into_patient(watch, i, world.p_WC, ends)
        if skin_distance(ends[2 * i], ends[2 * i + 1], watch.patient) > SKIN_MARGIN_M:
            return False
    return True


@compiled
def _place(watch: "Watch | Between", i: int, ends: Array) -> None:
    """End points of a capsule, world frame."""
    body = words(watch.bodies, watch.count)[i]
    p, R = doubles(watch.xpos, watch.nbody, 3)[body], doubles(watch.xmat, watch.nbody, 9)[body]
    local = doubles(watch.local, 2 * watch.count, 3)
    for k in range(2 * i, 2 * i + 2):
        x = local[k]
        for j in range(3):
            ends[k, j] = p[j] + R[3 * j] * x[0] + R[3 * j + 1] * x[1] + R[3 * j + 2] * x[2]


@compiled
def _into_patient(watch: Watch, i: int, p_WC: Array, ends: Array) -> None:
    """End points of a capsule from the world's into the patient's frame."""
    patient = watch.patient
    for k in range(2 * i, 2 * i + 2):
        x = ends[k, 0] - p_WC[0] - patient[0, 0]
        y = ends[k, 1] - p_WC[1] - patient[0, 1]
        ends[k, 2] -= p_WC[2] + patient[0, 2]
        ends[k, 0] = patient[1, 0] * x + patient[1, 1] * y
        ends[k, 1] = patient[1, 0] * y - patient[1, 1] * x


@compiled
def touching_pair(watch: "Watch | Between") -> tuple[int, int, float, float]:
    """The first pair of capsules that touch, how deep [m], and the room left, as `forbidden_contact`."""
    ends, radii = doubles(watch.ends, 2 * watch.count, 3), vector(watch.radii, watch.count)
    pairs, room = words(watch.pairs, 2 * watch.pair_count), math.inf
    for i in range(watch.count):
        _place(watch, i, ends)
    for m in range(watch.pair_count):
        i, j = pairs[2 * m], pairs[2 * m + 1]
        reach = radii[i] + radii[j]
        square = segment_distance_squared(ends[2 * i], ends[2 * i + 1], ends[2 * j], ends[2 * j + 1])
        if square < reach * reach:
            return i, j, reach - math.sqrt(square), 0.0
        room = min(room, math.sqrt(square) - reach)
    return 0, NOTHING, 0.0, room


@compiled
def forbidden_contact(watch: Watch, p_WC: Array) -> tuple[int, int, float, float]:
    """Capsule, what it touches and how deep [m], for a port at `p_WC` (3,) [m]; `NOTHING`: all is well.

    The last number is the room that is left [m], 0 where something touches.
    """
    ends, radii = doubles(watch.ends, 2 * watch.count, 3), vector(watch.radii, watch.count)
    shaft, patient = watch.shaft, watch.patient
    i, j, depth, room = touching_pair(watch)
    if j != NOTHING or not watch.has_patient:
        return i, j, depth, room
    for i in range(2, watch.count):
        _into_patient(watch, i, p_WC, ends)
        p0, p1 = ends[2 * i], ends[2 * i + 1]
        gap = table_gap(p0, p1, radii[i], patient[3], patient[4])
        if gap < 0.0:
            return i, _TABLE, -gap, 0.0
        room = min(room, gap)
        if i < shaft or shaft < 0:
            gap = body_gap(p0, p1, radii[i], patient[2])
            if gap < 0.0:
                return i, _BODY, -gap, 0.0
            room = min(room, gap)
    for i in range(shaft if shaft >= 0 else watch.count, watch.count):
        beside = skin_distance(ends[2 * i], ends[2 * i + 1], patient)
        if beside > SKIN_MARGIN_M:
            return i, _SKIN, beside, 0.0
    return 0, NOTHING, 0.0, room


@compiled
def body_gap(p0: Array, p1: Array, radius: float, semi_axes: Array) -> float:
    """A lower bound of the distance [m] of a capsule from the ellipsoid about the origin, negative inside.

    The capsule touches where its axis enters the ellipsoid with semi-axes larger by the radius, which lies a
    little inside the true offset surface. In its scaled space that is the distance from a segment to a unit
    sphere; the bound is (distance - 1) times the shortest semi-axis.
    """
    a = b = c = 0.0
    for j in range(3):
        scale = semi_axes[j] + radius
        x, u = p0[j] / scale, (p1[j] - p0[j]) / scale
        a, b, c = a + u * u, b + u * x, c + x * x
    s = min(max(-b / a, 0.0), 1.0) if a > 0.0 else 0.0
    square = max(c + s * (2.0 * b + s * a), 0.0)
    gap: float = (math.sqrt(square) - 1.0) * (semi_axes.min() + radius)
    return gap


@compiled
def table_gap(p0: Array, p1: Array, radius: float, centre: Array, half: Array) -> float:
    """A lower bound, but for 0.02 mm, of the distance [m] of a capsule from the box; -radius inside."""
    length = 0.0
    for j in range(3):
        length += (p1[j] - p0[j]) ** 2
    room = box_distance(p0, p1, 0.5, centre, half) - (radius + 0.5 * math.sqrt(length))
    if room > 0.0:
        return room
    low, high = 0.0, 1.0
    for _ in range(_TERNARY_STEPS):
        third = (high - low) / 3.0
        one, two = low + third, high - third
        if box_distance(p0, p1, one, centre, half) <= box_distance(p0, p1, two, centre, half):
            high = two
        else:
            low = one
    return box_distance(p0, p1, 0.5 * (low + high), centre, half) - radius


@compiled
def box_distance(p0: Array, p1: Array, s: float, centre: Array, half: Array) -> float:
    """Distance [m] of the point at share `s` of the segment from the box; convex in `s`."""
    square = 0.0
    for j in range(3):
        d = abs(p0[j] + s * (p1[j] - p0[j]) - centre[j]) - half[j]
        if d > 0.0:
            square += d * d
    return math.sqrt(square)


@compiled
def skin_distance(p0: Array, p1: Array, patient: Array) -> float:
    """Largest distance [m] from the port at which the segment passes the abdomen's skin; 0 if it does not."""
    port = scratch(3)
    port[0] = -patient[1, 0] * patient[0, 0] - patient[1, 1] * patient[0, 1]
    port[1] = -patient[1, 0] * patient[0, 1] + patient[1, 1] * patient[0, 0]
    port[2] = -patient[0, 2]
    a = b = c = 0.0
    for j in range(3):
        x, u = p0[j] / patient[2, j], (p1[j] - p0[j]) / patient[2, j]
        a, b, c = a + u * u, b + u * x, c + x * x
    root = b * b - a * (c - 1.0)
    if root <= 0.0:
        return 0.0
    furthest = 0.0
    for sign in (-1.0, 1.0):
        s = (-b + sign * math.sqrt(root)) / a
        if 0.0 < s < 1.0:
            square = 0.0
            for j in range(3):
                square += (p0[j] + s * (p1[j] - p0[j]) - port[j]) ** 2
            furthest = max(furthest, math.sqrt(square))
    return furthest
