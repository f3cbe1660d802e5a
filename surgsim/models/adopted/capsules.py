"""Capsules around the surfaces of an arm's links.

A capsule is where forbidden contacts are looked for: two end points [m] and a radius [m]. A link that one
would fit badly, such as one with an elbow, gets two or more.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from surgsim.array import Array
from surgsim.models.adopted.surface import thinned

_NUMBERS = 2 * 3 + 1  # of a capsule in a model: its ends and its radius
_DIRECTIONS = 96
_WORTH = 0.75
"""Two capsules are taken for one where they fill less than this share of its volume."""
_SPLITS = 2
"""How often a link is cut in two at most: four capsules."""
_SHARES = (0.2, 0.35, 0.5, 0.65, 0.8)
_FEWEST_POINTS = 8
_DIGITS = 4  # behind the point, of a number in metres
_REFINED = 5  # times that axes nearer to the best are tried
_CUT_CELL_M = 0.015


@dataclass(frozen=True, kw_only=True, eq=False)
class Capsule:
    """A capsule in its body's frame.

    Attributes:
        ends: End points (2, 3) [m].
        radius: [m].
    """

    ends: Array
    radius: float

    @property
    def volume(self) -> float:
        """[m³]."""
        length = float(np.linalg.norm(self.ends[1] - self.ends[0]))
        return float(np.pi * self.radius**2 * (length + 4.0 / 3.0 * self.radius))

    def depth(self, points: Array) -> Array:
        """How far inside each of the points (n, 3) is [m], negative outside (n,)."""
        along = self.ends[1] - self.ends[0]
        square = float(along @ along)
        share = np.zeros(len(points))
        if square > 0.0:
            share = np.clip((points - self.ends[0]) @ along / square, 0.0, 1.0)
        depth: Array = self.radius - np.linalg.norm(points - self.ends[0] - share[:, None] * along, axis=1)
        return depth


def capsules_in(numbers: ArrayLike) -> list[Capsule]:
    """The capsules that a numeric of an arm's model holds: ends and radius of each."""
    rows = np.reshape(numbers, (-1, _NUMBERS))
    return [Capsule(ends=row[:-1].reshape(2, 3), radius=float(row[-1])) for row in rows]


def capsules_around(points: Array, splits: int = _SPLITS) -> list[Capsule]:
    """Capsules that hold all of `points` (n, 3) [m], and little else.

    Args:
        points: Of a link's surface, dense: between two parts of it nothing is covered.
        splits: How often the points may be cut in two.
    """
    whole = capsule_around(points)
    if splits == 0 or len(points) < 2 * _FEWEST_POINTS:
        return [whole]
    cut = min(_cuts(thinned(points, _CUT_CELL_M)), key=lambda found: found.volume, default=None)
    if cut is None or cut.volume > _WORTH * whole.volume:
        return [whole]
    below = points @ cut.axis < cut.height
    if min(below.sum(), (~below).sum()) < _FEWEST_POINTS:
        return [whole]
    return [*capsules_around(points[below], splits - 1), *capsules_around(points[~below], splits - 1)]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Cut:
    """A plane that cuts points in two, and the volume [m³] of the capsules around both."""

    axis: Array
    height: float
    volume: float


def _cuts(points: Array) -> list[_Cut]:
    """Ways to cut the points in two across their main axes."""
    axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]
    found = []
    for axis in axes[:2]:
        heights = points @ axis
        low, high = heights.min(), heights.max()
        for share in _SHARES:
            height = float(low + share * (high - low))
            below = heights < height
            if min(below.sum(), (~below).sum()) >= _FEWEST_POINTS:
                volume = _quick(points[below]).volume + _quick(points[~below]).volume
                found.append(_Cut(axis=axis, height=height, volume=volume))
    return found


def capsule_around(points: Array) -> Capsule:
    """The smallest capsule found that holds all of `points` (n, 3) [m].

    Axes are tried all around, and then around the best; for each the least circle around the points across it
    is the radius, and the ends are as near as the round caps allow.
    """
    corners = _outermost(points)
    best = _best(corners, _hemisphere(_DIRECTIONS))
    spread = 0.2
    for _ in range(_REFINED):
        axis = best.ends[1] - best.ends[0]
        length = np.linalg.norm(axis)
        if length < 1e-9:
            break
        axis /= length
        near = axis + spread * _hemisphere(24)
        near = np.concatenate([near, 2 * axis - near])
        found = _best(corners, near / np.linalg.norm(near, axis=1, keepdims=True))
        best = min(best, found, key=lambda capsule: capsule.volume)
        spread /= 3.0
    best = Capsule(ends=np.round(best.ends, _DIGITS), radius=best.radius)
    needed = best.radius - best.depth(points).min()
    return Capsule(ends=best.ends, radius=float(np.ceil(needed * 10**_DIGITS) / 10**_DIGITS))


def _quick(points: Array) -> Capsule:
    """A capsule that holds nearly all of `points`, from few axes."""
    return _best(_outermost(points, 60), _hemisphere(24))


def _best(points: Array, axes: Array) -> Capsule:
    """The capsule of least volume about `points` (n, 3) [m] along one of the unit vectors `axes` (k, 3)."""
    side = np.eye(3)[np.argmin(np.abs(axes), axis=1)]
    x = np.cross(axes, side)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    y = np.cross(axes, x)
    flat = np.stack([x @ points.T, y @ points.T], axis=2)  # (k, n, 2)
    centre = _circle_centres(flat)
    square = np.sum((flat - centre[:, None]) ** 2, axis=2)
    radius = np.sqrt(square.max(axis=1))
    cap = np.sqrt(np.maximum(radius[:, None] ** 2 - square, 0.0))
    height = axes @ points.T
    high, low = np.max(height - cap, axis=1), np.min(height + cap, axis=1)
    round_ = high < low  # rounder than a capsule: a ball about the middle
    middle = 0.5 * (high + low)
    high, low = np.where(round_, middle, high), np.where(round_, middle, low)
    radius = np.where(round_, np.sqrt(np.max(square + (height - middle[:, None]) ** 2, axis=1)), radius)
    i = int(np.argmin(radius**2 * (high - low + 4.0 / 3.0 * radius)))
    across = centre[i, 0] * x[i] + centre[i, 1] * y[i]
    ends = across + np.array([low[i], high[i]])[:, None] * axes[i]
    return Capsule(ends=ends, radius=float(radius[i]))


def _circle_centres(points: Array, steps: int = 30) -> Array:
    """Centres (k, 2) of nearly the least circles around points (k, n, 2): Badoiu and Clarkson's steps."""
    centre: Array = 0.5 * (points.min(axis=1) + points.max(axis=1))
    rows = np.arange(len(points))
    for i in range(1, steps + 1):
        away = points - centre[:, None]
        farthest = np.argmax(away[:, :, 0] ** 2 + away[:, :, 1] ** 2, axis=1)
        centre = centre + away[rows, farthest] / (i + 1.0)
    return centre


def _outermost(points: Array, directions: int = 200) -> Array:
    """Those of `points` (n, 3) that are farthest in one of many directions."""
    ways = _hemisphere(directions)
    heights = points @ ways.T
    found = np.unique(np.concatenate([heights.argmax(axis=0), heights.argmin(axis=0)]))
    outermost: Array = points[found]
    return outermost


def _hemisphere(count: int) -> Array:
    """Unit vectors (count, 3) spread over half a sphere (Fibonacci's spiral)."""
    i = np.arange(count) + 0.5
    z, turn = i / count, np.pi * (1.0 + np.sqrt(5.0)) * i
    rim = np.sqrt(1.0 - z**2)
    return np.stack([rim * np.cos(turn), rim * np.sin(turn), z], axis=1)
