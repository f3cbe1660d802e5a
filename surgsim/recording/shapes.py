"""Triangles of MuJoCo's geoms, with normals, in the frame of their body."""

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from surgsim.array import Array

_AROUND = 40
_INFINITE_PLANE_M = 5.0
_CREASE_COSINE = np.cos(np.deg2rad(40.0))


@dataclass(frozen=True, eq=False)
class Triangles:
    """A surface.

    Attributes:
        points: Vertices (n, 3) [m].
        normals: Unit normals (n, 3).
        faces: Vertex indices, counter-clockwise from outside (m, 3).
    """

    points: Array
    normals: Array
    faces: NDArray[np.int64]


def joined(parts: list[Triangles]) -> Triangles:
    """All parts as one surface."""
    starts = np.cumsum([0, *(len(part.points) for part in parts[:-1])])
    return Triangles(
        np.concatenate([part.points for part in parts]),
        np.concatenate([part.normals for part in parts]),
        np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=True)]),
    )


def geom_triangles(model: mujoco.MjModel, geom: int) -> Triangles | None:
    """Surface of a geom in its body's frame; None for kinds that are not drawn (height fields, SDFs)."""
    kind = model.geom_type[geom]
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        local = _mesh(model, int(model.geom_dataid[geom]))
    elif kind in _SHAPES:
        local = _SHAPES[kind](model.geom_size[geom])
    else:
        return None
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
    turned = turn.reshape(3, 3).T
    return Triangles(local.points @ turned + model.geom_pos[geom], local.normals @ turned, local.faces)


def _mesh(model: mujoco.MjModel, mesh: int) -> Triangles:
    """A mesh with normals smoothed over faces but not over edges; MuJoCo's own smooth sharp edges too."""
    first, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    start, size = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    points = model.mesh_vert[start : start + size].astype(np.float64)
    faces = model.mesh_face[first : first + count].astype(np.int64)
    normals = _corner_normals(points, faces)
    quantised = np.rint(1000.0 * (normals + 1.0)).astype(np.int64)  # 11 bits each
    keys = faces.ravel() << 33 | quantised[:, 0] << 22 | quantised[:, 1] << 11 | quantised[:, 2]
    _, kept, shared = np.unique(keys, return_index=True, return_inverse=True)
    return Triangles(points[faces.ravel()[kept]], normals[kept], shared.reshape(-1, 3))


def _corner_normals(points: Array, faces: NDArray[np.int64]) -> Array:
    """Normal of every face's every corner (3 m, 3).

    It is the mean, weighted by area, over those faces at the corner's vertex that meet this face at less than
    the crease angle.
    """
    a, b, c = (points[faces[:, i]] for i in range(3))
    areas = np.cross(b - a, c - a)
    normals = areas / np.maximum(np.linalg.norm(areas, axis=1, keepdims=True), 1e-300)
    vertex = faces.ravel()
    order, counts = np.argsort(vertex, kind="stable"), np.bincount(vertex)
    others = counts[vertex]  # corners at the same vertex
    mine = np.repeat(np.arange(len(vertex)), others)
    nth = np.arange(len(mine)) - np.repeat(np.cumsum(others) - others, others)
    theirs = order[np.repeat((np.cumsum(counts) - counts)[vertex], others) + nth]
    close = np.einsum("ij,ij->i", normals[mine // 3], normals[theirs // 3]) > _CREASE_COSINE
    mine, theirs = mine[close], theirs[close]
    total = np.stack([np.bincount(mine, areas[theirs // 3, k], len(vertex)) for k in range(3)], axis=-1)
    smooth: Array = total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300)
    return smooth


def _grid(rows: int, columns: int) -> NDArray[np.int64]:
    """Two triangles for each cell of a grid of vertices."""
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    return np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)


def _circle() -> Array:
    angle = np.linspace(0.0, 2 * np.pi, _AROUND + 1)
    return np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=-1)


def _turned(radius: Array, height: Array, normals: Array) -> Triangles:
    """Surface of revolution about z of a profile from top to bottom; `normals` (k, 2) are (radial, z)."""
    circle, up = _circle(), np.array([0.0, 0.0, 1.0])
    points = radius[:, None, None] * circle + height[:, None, None] * up
    directions = normals[:, :1, None] * circle + normals[:, 1:, None] * up
    return Triangles(points.reshape(-1, 3), directions.reshape(-1, 3), _grid(len(radius), _AROUND + 1))


def _cylinder(size: Array) -> Triangles:
    r, h = float(size[0]), float(size[1])
    flat = [np.array([0.0, 1.0]), np.array([1.0, 0.0]), np.array([0.0, -1.0])]
    profiles = [([0.0, r], [h, h]), ([r, r], [h, -h]), ([r, 0.0], [-h, -h])]
    return joined(
        [
            _turned(np.array(radius), np.array(height), np.tile(normal, (2, 1)))
            for (radius, height), normal in zip(profiles, flat, strict=True)
        ]
    )


def _capsule(size: Array) -> Triangles:
    angle = np.linspace(0.0, np.pi, _AROUND // 2)
    normals = np.stack([np.sin(angle), np.cos(angle)], axis=-1)
    height = size[0] * normals[:, 1] + size[1] * np.sign(normals[:, 1])
    return _turned(size[0] * normals[:, 0], height, normals)


def _ellipsoid(size: Array) -> Triangles:
    angle = np.linspace(0.0, np.pi, _AROUND)
    normals = np.stack([np.sin(angle), np.cos(angle)], axis=-1)
    unit = _turned(normals[:, 0], normals[:, 1], normals)
    directions = unit.points / size
    return Triangles(
        unit.points * size, directions / np.linalg.norm(directions, axis=1, keepdims=True), unit.faces
    )


def _sphere(size: Array) -> Triangles:
    return _ellipsoid(np.full(3, size[0]))


def _box(size: Array) -> Triangles:
    sides = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            normal, along, across = np.zeros(3), np.zeros(3), np.zeros(3)
            normal[axis], along[(axis + 1) % 3], across[(axis + 2) % 3] = sign, sign, 1.0
            sides.append(_quad(normal * size, along * size, across * size, normal))
    return joined(sides)


def _plane(size: Array) -> Triangles:
    half = np.where(size[:2] > 0.0, size[:2], _INFINITE_PLANE_M)
    x, y, z = np.eye(3)
    return _quad(np.zeros(3), half[0] * x, half[1] * y, z)


def _quad(centre: Array, along: Array, across: Array, normal: Array) -> Triangles:
    points = centre + np.array([-along - across, along - across, along + across, across - along])
    return Triangles(points, np.tile(normal, (4, 1)), np.array([[0, 1, 2], [0, 2, 3]]))


_SHAPES: dict[int, Callable[[Array], Triangles]] = {
    int(mujoco.mjtGeom.mjGEOM_PLANE): _plane,
    int(mujoco.mjtGeom.mjGEOM_SPHERE): _sphere,
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): _capsule,
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): _ellipsoid,
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): _cylinder,
    int(mujoco.mjtGeom.mjGEOM_BOX): _box,
}
