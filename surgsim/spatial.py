"""Small fixed-size geometry, written out: `numpy.cross` costs 14 us a call."""

import math

import numpy as np

from surgsim.array import Array
from surgsim.compiled import compiled


def cross(a: Array, b: Array) -> Array:
    """Cross product of two 3-vectors."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def skew(a: Array) -> Array:
    """Matrix (3, 3) with `skew(a) @ b == cross(a, b)`."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def unit(a: Array) -> Array:
    """`a` scaled to length one.

    Raises:
        ValueError: If `a` is zero or not finite.
    """
    length = float(np.linalg.norm(a))
    if not (np.isfinite(length) and length > 0.0):
        raise ValueError(f"a direction must be a finite non-zero vector, not {a}")
    return a / length


def plane_axes(normal: Array, direction: Array) -> tuple[Array, Array, Array]:
    """Right-handed unit axes (x, y, z): z along `normal`, x along `direction` made normal to it.

    Raises:
        ValueError: If either is zero or they are parallel.
    """
    z = unit(normal)
    along = direction - z * (z @ direction)
    if np.linalg.norm(along) < 1e-9 * np.linalg.norm(direction):
        raise ValueError("the direction is parallel to the plane's normal")
    x = unit(along)
    return x, cross(z, x), z


def nearest_on_line(p: Array, a: Array, b: Array) -> Array:
    """Points (n, 3) of the lines through `a` and `b` that are nearest to `p`, each (n, 3) [m].

    p_b + d dᵀ(p - p_b), d the line's direction.
    """
    d = b - a
    d = d / np.linalg.norm(d, axis=1, keepdims=True)
    nearest: Array = b + np.sum((p - b) * d, axis=1, keepdims=True) * d
    return nearest


@compiled
def shaft_distance(p_C: Array, p_S: Array, p_R: Array) -> float:
    """Distance of point `p_C` from the line through `p_R` and `p_S` [m]: the RCM error."""
    ax, ay, az = p_S[0] - p_R[0], p_S[1] - p_R[1], p_S[2] - p_R[2]
    bx, by, bz = p_C[0] - p_S[0], p_C[1] - p_S[1], p_C[2] - p_S[2]
    cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return math.sqrt((cx * cx + cy * cy + cz * cz) / (ax * ax + ay * ay + az * az))


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
        elif e <= 1e-12:
            s = min(max(-c / a, 0.0), 1.0)
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
