"""Surfaces of an arm's links: points on them, and what is drawn."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from surgsim.array import Array

SPACING_M = 0.01
"""Greatest distance of the points that stand for a surface."""
_AROUND = 16
_NO_COLOUR = np.array([0.5, 0.5, 0.5, 1.0], dtype=np.float32)  # what MuJoCo gives a geom without one
_MOST_CUTS = 200  # of an edge


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """Triangles in the frame of a link.

    Attributes:
        points: Corners (n, 3) [m].
        faces: Corners of the triangles (m, 3).
        rgba: Colour (4,).
    """

    points: Array
    faces: NDArray[np.int64]
    rgba: Array

    def sampled(self, spacing_m: float = SPACING_M) -> Array:
        """Points of the surface (k, 3) [m], none of it farther than `spacing_m` from one."""
        a, b, c = (self.points[self.faces[:, i]] for i in range(3))
        found = [self.points]
        longest = np.max(np.linalg.norm([b - a, c - b, a - c], axis=2), axis=0)
        cuts = np.minimum(np.ceil(longest / spacing_m), _MOST_CUTS).astype(int)
        for parts in np.unique(cuts[cuts > 1]):
            mine = cuts == parts
            u, v = (w[:, None] / parts for w in np.divmod(np.arange((parts + 1) ** 2), parts + 1))
            inside = (u + v <= 1.0 + 1e-9).ravel()
            u, v = u[inside], v[inside]
            corner, one, other = (x[mine][:, None] for x in (a, b - a, c - a))
            found.append((corner + u * one + v * other).reshape(-1, 3))
        return np.concatenate(found)


def surface_of(
    model: mujoco.MjModel, data: mujoco.MjData, geom: int, p_WL: Array, R_WL: Array
) -> Surface | None:
    """The surface of a geom in the frame of a link; None for planes and height fields.

    Args:
        model: The model.
        data: Where everything is, with all joints at their zero.
        geom: The geom.
        p_WL: Place of the link's frame there (3,) [m].
        R_WL: Its axes there (3, 3).
    """
    kind = int(model.geom_type[geom])  # NumPy's own integer is in no tuple of MuJoCo's kinds
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = int(model.geom_dataid[geom])
        start, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        first, faces = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
        points = model.mesh_vert[start : start + count].astype(float)
        triangles = model.mesh_face[first : first + faces].astype(np.int64)
    else:
        points = _round(kind, model.geom_size[geom])
        if points is None:
            return None
        triangles = hull(points)
    turn, place = data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom]
    points = (points @ turn.T + place - p_WL) @ R_WL
    material, rgba = model.geom_matid[geom], model.geom_rgba[geom]
    if material >= 0 and np.all(rgba == _NO_COLOUR):  # a colour of its own counts before the material's
        rgba = model.mat_rgba[material]
    return Surface(points=points, faces=triangles, rgba=np.array(rgba, dtype=float))


def _round(kind: int, size: Array) -> Array | None:
    """Points of a primitive shape (n, 3) [m], whose hull it is."""
    turn = np.linspace(0.0, 2 * np.pi, _AROUND, endpoint=False)
    circle = np.stack([np.cos(turn), np.sin(turn), np.zeros(_AROUND)], axis=1) / np.cos(np.pi / _AROUND)
    up = np.array([0.0, 0.0, 1.0])
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
        box: Array = corners * size
        return box
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return np.concatenate([size[0] * circle + h * size[1] * up for h in (-1, 1)])
    if kind in (mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_ELLIPSOID, mujoco.mjtGeom.mjGEOM_CAPSULE):
        slope = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 9)
        ball = np.concatenate([np.cos(s) * circle + np.sin(s) * up for s in slope])
        if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            return ball * size
        ball = ball * float(size[0])
        if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
            return ball
        return np.concatenate([ball + np.where(ball[:, 2:] >= 0.0, 1.0, -1.0) * size[1] * up])
    return None


def hull(points: Array) -> NDArray[np.int64]:
    """Triangles (m, 3) of the convex hull of `points`, seen anticlockwise from outside; none if flat."""
    from scipy.spatial import ConvexHull, QhullError  # 0.3 s to import, for adopted arms alone

    try:
        found = ConvexHull(points)
    except (QhullError, ValueError):
        return np.zeros((0, 3), dtype=np.int64)
    faces: NDArray[np.int64] = found.simplices.astype(np.int64)
    a, b, c = (points[faces[:, i]] for i in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), found.equations[:, :3]) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return faces


def thinned(points: Array, cell_m: float) -> Array:
    """One of `points` (n, 3) [m] in each cube of that size."""
    cells = np.floor(points / cell_m).astype(np.int64) - np.int64(-(1 << 20))
    kept = np.unique(cells[:, 0] << 42 | cells[:, 1] << 21 | cells[:, 2], return_index=True)[1]
    found: Array = points[kept]
    return found


def coarser(surface: Surface, most: int) -> Surface:
    """A surface of at most about `most` triangles that looks alike: corners that are near become one."""
    if len(surface.faces) <= most:
        return surface
    low, high = surface.points.min(axis=0), surface.points.max(axis=0)
    cell = float(np.max(high - low)) / 400.0
    for _ in range(24):
        keys = np.floor((surface.points - low) / cell).astype(np.int64)
        _, kept, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        faces = inverse.ravel()[surface.faces]
        whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 0] != faces[:, 2])
        faces = faces[whole]
        first = np.argmin(faces, axis=1)  # the same triangle begins at the same corner
        rolled = np.stack([faces[np.arange(len(faces)), (first + k) % 3] for k in range(3)], axis=1)
        faces = np.unique(rolled, axis=0)
        if len(faces) <= most:
            return Surface(points=surface.points[kept], faces=faces, rgba=surface.rgba)
        cell *= 1.3
    return surface
