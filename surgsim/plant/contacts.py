"""Looks for contacts that must not be: of the arm with itself, with the patient and with the table."""

import math
from typing import NamedTuple

import mujoco
import numpy as np
from numba import types
from numpy.typing import NDArray

from surgsim.compiled import compiled
from surgsim.models.build import Scene
from surgsim.plant.truth import Contact
from surgsim.tick.arrays import A1, A2, A3, I1, I2

Array = NDArray[np.float64]
Ids = NDArray[np.intp]

SKIN_MARGIN_M = 0.1
"""How far from the port the shaft may pass the skin; nearer is the RCM limit's matter."""
NOTHING, _BODY, _TABLE, _SKIN = -9, -1, -2, -3
_TERNARY_STEPS = 24


class Watch(NamedTuple):
    """What is watched, as arrays.

    Attributes:
        xpos: Body places (nbody, 3) [m].
        xmat: Body orientations (nbody, 9).
        bodies: The body that each capsule is fixed to (n,).
        local: End points in the body's frame (n, 2, 3) [m].
        radii: Of the capsules (n,) [m].
        pairs: Capsules that can touch each other (m, 2).
        shaft: The shaft's capsule, or -1 (1,).
        patient: Rows of the patient's and the table's numbers, none without a port (5, 3).
        ends: Filled with the end points, world frame (n, 2, 3) [m].
    """

    xpos: Array
    xmat: Array
    bodies: Ids
    local: Array
    radii: Array
    pairs: Ids
    shaft: Ids
    patient: Array
    ends: Array


WATCH = types.NamedTuple([A2, A2, I1, A3, A1, I2, I1, A2, A3], Watch)  # type: ignore[no-untyped-call]


class ContactWatch:
    """Distances between the collision shapes where the bodies now are; nothing is pushed apart.

    Attributes:
        arrays: What the kernel `forbidden_contact` works on.
    """

    def __init__(self, scene: Scene, data: mujoco.MjData) -> None:
        s = scene.shapes
        self._names = s.names
        self.arrays = Watch(
            xpos=data.xpos,
            xmat=data.xmat,
            bodies=np.array(s.bodies, dtype=np.int64),
            local=np.array(s.ends, dtype=float),
            radii=np.array(s.radii, dtype=float),
            pairs=np.array(s.pairs, dtype=np.int64).reshape(-1, 2),
            shaft=np.array([s.shaft], dtype=np.int64),
            patient=np.array(s.patient, dtype=float).reshape(-1, 3),
            ends=np.empty_like(s.ends),
        )

    def look(self, p_WC: Array) -> Contact | None:
        """The first forbidden contact found, or None.

        Args:
            p_WC: Port (3,) [m], which patient and table move with; not used without one.
        """
        a, b, depth = forbidden_contact(self.arrays, p_WC)
        return None if b == NOTHING else self._contact(a, b, 1e3 * depth)

    def _contact(self, a: int, b: int, depth_mm: float) -> Contact:
        name = self._names[a]
        if b == _SKIN:
            return Contact(
                detail=f"{name} passes the skin {depth_mm:.1f} mm from the port", with_patient=True
            )
        other = {_BODY: "the patient", _TABLE: "the table"}.get(b) or self._names[b]
        return Contact(detail=f"{name} touches {other}, {depth_mm:.1f} mm deep", with_patient=b < 0)


@compiled
def forbidden_contact(watch: Watch, p_WC: Array) -> tuple[int, int, float]:
    """Capsule, what it touches and how deep [m], for a port at `p_WC` (3,) [m]; `NOTHING`: all is well."""
    xpos, xmat, bodies, local = watch.xpos, watch.xmat, watch.bodies, watch.local
    radii, pairs, shaft, patient, ends = watch.radii, watch.pairs, watch.shaft[0], watch.patient, watch.ends
    for i in range(len(bodies)):
        p, R = xpos[bodies[i]], xmat[bodies[i]]
        for k in range(2):
            for j in range(3):
                x = local[i, k]
                ends[i, k, j] = p[j] + R[3 * j] * x[0] + R[3 * j + 1] * x[1] + R[3 * j + 2] * x[2]
    for m in range(len(pairs)):
        i, j = pairs[m, 0], pairs[m, 1]
        reach = radii[i] + radii[j]
        square = segment_distance_squared(ends[i, 0], ends[i, 1], ends[j, 0], ends[j, 1])
        if square < reach * reach:
            return i, j, reach - math.sqrt(square)
    if len(patient) == 0:
        return 0, NOTHING, 0.0
    for i in range(2, len(bodies)):
        for k in range(2):
            x = ends[i, k, 0] - p_WC[0] - patient[0, 0]
            y = ends[i, k, 1] - p_WC[1] - patient[0, 1]
            ends[i, k, 2] -= p_WC[2] + patient[0, 2]
            ends[i, k, 0] = patient[1, 0] * x + patient[1, 1] * y
            ends[i, k, 1] = patient[1, 0] * y - patient[1, 1] * x
        depth = table_depth(ends[i, 0], ends[i, 1], radii[i], patient[3], patient[4])
        if depth > 0.0:
            return i, _TABLE, depth
        if i != shaft:
            depth = body_depth(ends[i, 0], ends[i, 1], radii[i], patient[2])
            if depth > 0.0:
                return i, _BODY, depth
    if shaft >= 0:
        beside = skin_distance(ends[shaft, 0], ends[shaft, 1], patient)
        if beside > SKIN_MARGIN_M:
            return shaft, _SKIN, beside
    return 0, NOTHING, 0.0


@compiled
def segment_distance_squared(a0: Array, a1: Array, b0: Array, b1: Array) -> float:
    """Least squared distance [m²] between two segments, each of positive length or a point.

    Source: Ericson, Real-Time Collision Detection, 2005, section 5.1.9.
    """
    a = e = b = c = f = 0.0
    for j in range(3):
        u, v, r = a1[j] - a0[j], b1[j] - b0[j], a0[j] - b0[j]
        a, e, b, c, f = a + u * u, e + v * v, b + u * v, c + u * r, f + v * r
    s = t = 0.0
    if a > 1e-12:
        det = a * e - b * b
        if det > 1e-12:
            s = min(max((b * f - c * e) / det, 0.0), 1.0)
        t = (b * s + f) / e if e > 1e-12 else 0.0
        if t < 0.0 or t > 1.0:
            t = min(max(t, 0.0), 1.0)
            s = min(max((b * t - c) / a, 0.0), 1.0)
    elif e > 1e-12:
        t = min(max(f / e, 0.0), 1.0)
    square = 0.0
    for j in range(3):
        d = a0[j] + s * (a1[j] - a0[j]) - b0[j] - t * (b1[j] - b0[j])
        square += d * d
    return square


@compiled
def body_depth(p0: Array, p1: Array, radius: float, semi_axes: Array) -> float:
    """How deep [m] a capsule is in the ellipsoid about the origin; 0 outside.

    The capsule touches where its axis enters the ellipsoid with semi-axes larger by the radius, which lies a
    little inside the true offset surface. In its scaled space that is the distance from a segment to a unit
    sphere; the depth is (1 - distance) times the shortest semi-axis, a lower bound.
    """
    a = b = c = 0.0
    for j in range(3):
        scale = semi_axes[j] + radius
        x, u = p0[j] / scale, (p1[j] - p0[j]) / scale
        a, b, c = a + u * u, b + u * x, c + x * x
    s = min(max(-b / a, 0.0), 1.0) if a > 0.0 else 0.0
    square = max(c + s * (2.0 * b + s * a), 0.0)
    depth: float = max(0.0, 1.0 - math.sqrt(square)) * (semi_axes.min() + radius)
    return depth


@compiled
def table_depth(p0: Array, p1: Array, radius: float, centre: Array, half: Array) -> float:
    """How deep [m] a capsule is in the box; 0 outside, the radius where its axis enters the box."""
    length = 0.0
    for j in range(3):
        length += (p1[j] - p0[j]) ** 2
    if box_distance(p0, p1, 0.5, centre, half) > radius + 0.5 * math.sqrt(length):
        return 0.0
    low, high = 0.0, 1.0
    for _ in range(_TERNARY_STEPS):
        third = (high - low) / 3.0
        one, two = low + third, high - third
        if box_distance(p0, p1, one, centre, half) <= box_distance(p0, p1, two, centre, half):
            high = two
        else:
            low = one
    return max(0.0, radius - box_distance(p0, p1, 0.5 * (low + high), centre, half))


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
    port = np.empty(3)
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
