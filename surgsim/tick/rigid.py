"""Small motions of a rigid body as twists, and back: the exponential of SE(3) and its logarithm.

A twist is (v, w), linear [m] before angular [rad]. With W = [w]x and the angle t = |w|,

    exp: R = I + a W + b W^2,  p = (I + b W + c W^2) v
    log: w = t / (2 sin t) (R - R^T)v,  v = (I - W/2 + d W^2) p
    a = sin t / t,  b = (1 - cos t) / t^2,  c = (t - sin t) / t^3,  d = (1 - a / (2 b)) / t^2

where the last (..)v takes the vector out of a skew matrix.

Source: Murray, Li and Sastry, A Mathematical Introduction to Robotic Manipulation (1994), 2.3.
"""

import math

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.tick.algebra import cross, norm
from surgsim.tick.scratch import scratch

_SERIES = 1e-4
"""Square of the angle below which the coefficients are taken from their series."""


@compiled
def _coefficients(square: float) -> tuple[float, float, float]:
    """a, b and c for the square of the angle."""
    if square < _SERIES:
        return (
            1.0 - square / 6.0 * (1.0 - square / 20.0),
            0.5 - square / 24.0 * (1.0 - square / 30.0),
            1.0 / 6.0 - square / 120.0 * (1.0 - square / 42.0),
        )
    t = math.sqrt(square)
    return math.sin(t) / t, (1.0 - math.cos(t)) / square, (t - math.sin(t)) / (t * square)


@compiled
def exponential(v: Array, w: Array, p: Array, R: Array) -> None:
    """Fill p (3,) [m] and R (3, 3) with the motion of the twist v (3,) [m], w (3,) [rad]."""
    square = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    a, b, c = _coefficients(square)
    once, twice = scratch(3), scratch(3)
    cross(w, v, once)
    cross(w, once, twice)
    for i in range(3):
        p[i] = v[i] + b * once[i] + c * twice[i]
        for j in range(3):
            R[i, j] = b * w[i] * w[j]
        R[i, i] += 1.0 - b * square
    for i in range(3):
        k, m = (i + 1) % 3, (i + 2) % 3
        R[m, k] += a * w[i]
        R[k, m] -= a * w[i]


@compiled
def logarithm(p: Array, R: Array, v: Array, w: Array) -> None:
    """Fill v (3,) [m] and w (3,) [rad] with the twist of the motion p (3,) [m], R (3, 3); turns below pi."""
    for i in range(3):
        k, m = (i + 1) % 3, (i + 2) % 3
        w[i] = 0.5 * (R[m, k] - R[k, m])
    sine = norm(w)
    t = math.atan2(sine, 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0))
    if sine > 0.0:
        for i in range(3):
            w[i] *= t / sine
    a, b, _ = _coefficients(t * t)
    d = 1.0 / 12.0 + t * t / 720.0
    if t * t >= _SERIES:
        d = (1.0 - 0.5 * a / b) / (t * t)
    once, twice = scratch(3), scratch(3)
    cross(w, p, once)
    cross(w, once, twice)
    for i in range(3):
        v[i] = p[i] - 0.5 * once[i] + d * twice[i]
