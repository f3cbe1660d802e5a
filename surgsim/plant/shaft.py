"""Where the shaft is, also where it bends.

A shaft that bends (`surgsim.models.bending`) is straight from hinge to hinge. Near a point it is the piece on
whose side of the bisecting planes between the pieces the point lies: there the distances to both neighbours
are the same, so that the distance to the shaft does not jump. Of a stiff shaft there is one piece.
"""

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.models.bending import BEND_JOINTS, bends, piece_end
from surgsim.models.build import Scene
from surgsim.tick.algebra import dot
from surgsim.tick.arrays import World
from surgsim.tick.scratch import scratch
from surgsim.tick.views import doubles, site_place

_LEAST = 1e-12


@compiled
def _vertex(world: World, joints: int, k: int, out: Array) -> None:
    """End k of the pieces (3,) [m]: the entry, the hinges, the shaft's end."""
    for i in range(3):
        if k == 0:
            out[i] = site_place(world, world.entry)[i]
        elif 2 * k > joints:
            out[i] = site_place(world, world.shaft_end)[i]
        else:
            anchors = doubles(world.xanchor, world.njnt, 3)
            out[i] = anchors[world.first_joint + world.q.size + 2 * (k - 1), i]


@compiled
def shaft_line(world: World, joints: int, point: Array, entry: Array, tip: Array) -> int:
    """Fill `entry` and `tip` (3,) [m]: where they were if all of the shaft went on as the piece at `point`.

    Args:
        world: The plant's.
        joints: Of the shaft; 0: it is stiff.
        point: p (3,) [m].
        entry: Filled.
        tip: Filled: the shaft's end.

    Returns:
        How many of the shaft's joints move the piece.
    """
    _vertex(world, joints, 0, entry)
    _vertex(world, joints, 1, tip)
    if joints == 0:
        return 0
    begin, end, u, ahead = scratch(3), scratch(3), scratch(3), scratch(3)
    chosen, before, whole = -1, 0.0, 0.0
    for k in range(joints // 2 + 1):
        _vertex(world, joints, k, begin)
        _vertex(world, joints, k + 1, end)
        length = _direction(begin, end, ahead)
        past = 0.0
        for i in range(3):
            past += (point[i] - begin[i]) * (ahead[i] + (u[i] if k > 0 else 0.0))
        if k == 0 or (chosen == k - 1 and past > 0.0):
            chosen, before = k, whole
            for i in range(3):
                u[i], entry[i] = ahead[i], begin[i]
        whole += length
    for i in range(3):
        entry[i] -= before * u[i]
        tip[i] = entry[i] + whole * u[i]
    return 2 * chosen


@compiled
def _direction(begin: Array, end: Array, u: Array) -> float:
    """Fill `u` (3,) with the direction from the one to the other; their distance [m]."""
    for i in range(3):
        u[i] = end[i] - begin[i]
    length: float = np.sqrt(dot(u, u))
    for i in range(3):
        u[i] /= length
    return length


@compiled
def see_bent(world: World, joints: int) -> None:
    """Let the line from p_WR to p_WT pass through the bent shaft's point nearest to the trocar.

    The point p_WR is as far from the tip as the entry of the straight shaft. The distance of the trocar from
    that line is its distance from the shaft, but for the cosine of the angle between the two. Past the last
    hinge the line is the last piece's own.
    """
    if joints == 0 or world.trocar < 0:
        return
    entry, tip, to = scratch(3), scratch(3), scratch(3)
    moved = shaft_line(world, joints, world.p_WC, entry, tip)
    length = _direction(tip, entry, to)
    if moved < joints:
        s = 0.0
        for i in range(3):
            s += (world.p_WC[i] - tip[i]) * to[i]
        for i in range(3):
            entry[i] = tip[i] + s * to[i]
        _direction(world.p_WT, entry, to)
    for i in range(3):
        world.p_WR[i] = world.p_WT[i] + length * to[i]


@compiled
def nearest_of_shaft(world: World, out: Array) -> None:
    """Fill `out` (3,) [m] with the point of a stiff shaft's axis that is nearest to the trocar."""
    along = scratch(3)
    _direction(world.p_WR, world.p_WS, along)
    s = 0.0
    for i in range(3):
        s += (world.p_WC[i] - world.p_WS[i]) * along[i]
    for i in range(3):
        out[i] = world.p_WS[i] + s * along[i]


def bend_joints(scene: Scene) -> int:
    """Number of the shaft's joints, which must follow the arm's.

    Raises:
        ValueError: If they do not.
    """
    parts, count, n = scene.parts, bends(scene.parts), len(scene.dof_ids)
    first = int(scene.dof_ids[0])
    ids = [int(parts.joint(name).dofadr[0]) for name in BEND_JOINTS[:count]]
    if ids != list(range(first + n, first + n + count)):
        raise ValueError(f"the shaft's degrees of freedom {ids} do not follow the arm's")
    return count


def bend_stiffness(scene: Scene) -> Array:
    """Of the joints of a shaft that bends (8,) [N m/rad]."""
    return np.array([np.ravel(scene.parts.joint(name).stiffness)[0] for name in BEND_JOINTS])


def piece_lengths(scene: Scene) -> Array:
    """Of the pieces of a shaft that bends, from the entry on (k,) [m]."""
    model, hinges = scene.model, bend_joints(scene) // 2
    ends = [float(scene.parts.site(piece_end(k)).pos[2]) for k in range(1, hinges + 1)]
    ends[0] -= float(model.site_pos[scene.shaft_entry_site][2])
    return np.array([*ends, float(model.site_pos[scene.tip_site][2])])


def lateral_masses(scene: Scene, places: Array, h: float) -> Array:
    """What a force across the shaft accelerates as a mass (k,) [kg]; its adapter is held, and it bends.

    Of the masses M, the armature A, the stiffness K and the damping D of the hinges an explicit force meets

        m(a) = 1 / (J N^-1 J^T),    N = M + A - h² K / 4 + h D / 2,    J = (a - x_i)+

    for the implicit damping and the spring of the hinges themselves take part in a step.

    Args:
        scene: With a shaft that bends.
        places: Distances a from the shaft's entry (k,) [m].
        h: The timestep [s].
    """
    model, count = scene.model, bend_joints(scene)
    data, whole = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, whole)
    dofs = int(scene.dof_ids[-1]) + 1 + np.arange(0, count, 2)
    stiffness = bend_stiffness(scene)[::2]
    N = whole[np.ix_(dofs, dofs)]  # its armature is that of the model's own timestep
    N += np.diag(0.5 * h * model.dof_damping[dofs] - 0.25 * model.opt.timestep**2 * stiffness)
    J = np.maximum(places[:, None] - np.cumsum(piece_lengths(scene))[:-1], 0.0)
    mobility = np.einsum("ki,ik->k", J, np.linalg.solve(N, J.T))
    masses: Array = 1.0 / np.maximum(mobility, _LEAST)
    return masses


def place_on_shaft(scene: Scene, back_m: float) -> tuple[int, int, float]:
    """A point of the shaft's axis, `back_m` [m] from its end.

    Returns:
        The body that it is on, a site there whose z is the axis, and the way back from the site [m].
    """
    model, site, left = scene.model, scene.shaft_end_site, back_m
    body = int(model.site_bodyid[site])
    for k in range(bend_joints(scene) // 2, 0, -1):
        length = float(model.site_pos[site][2])
        if left <= length:
            break
        left -= length
        body = int(model.body_parentid[body])
        site = int(scene.parts.site(piece_end(k)).id)
    return body, site, left
