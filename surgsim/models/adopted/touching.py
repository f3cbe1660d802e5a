"""Which of an arm's parts can touch: pairs whose surfaces never meet are not looked at.

A capsule holds more than the link does, so that neighbours' capsules overlap where nothing touches.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.models.adopted.capsules import Capsule
from surgsim.models.adopted.surface import SPACING_M
from surgsim.spatial import segment_distance_squared

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

NEXT_THAT_CAN_TOUCH = 3
"""Along the chain: nearer parts are held apart by the joints' ranges."""
_POSTURES = 240
_LOOKED_AT = 24
_ALWAYS = 0.6
"""Share of the postures in which parts overlap that are drawn into each other."""
_MOST_POINTS = 1500


def never_touch(
    model: mujoco.MjModel,
    bodies: Mapping[str, str],
    capsules: Mapping[str, Sequence[Capsule]],
    points: Mapping[str, Array],
    ranges: Array,
    home: Array | None,
) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """Pairs of parts that need not be looked at: those that never touch, and those that always do.

    Args:
        model: The arm.
        bodies: Part, from the base on, to the body that it is fixed to.
        capsules: Part to its capsules, in the body's frame.
        points: Part to points of its surface (k, 3) [m], in the body's frame.
        ranges: Of the joints (n, 2) [rad].
        home: A posture in which nothing touches (n,) [rad], if one is known.
    """
    from scipy.spatial import cKDTree  # 0.3 s to import, for adopted arms alone

    rng = np.random.default_rng(0)
    postures = rng.uniform(ranges[:, 0], ranges[:, 1], (_POSTURES, len(ranges)))
    if home is not None:
        postures[0] = home
    places = [_places(model, q, bodies) for q in postures]
    points = {part: _thinned(cloud, rng) for part, cloud in points.items()}
    trees = {part: cKDTree(cloud) for part, cloud in points.items() if len(cloud)}
    apart: list[tuple[str, str]] = []
    joined: list[tuple[str, str]] = []
    for one, other in _pairs(list(bodies)):
        near = [i for i, place in enumerate(places) if _overlap(place, one, other, capsules)]
        if not near:
            continue
        if one not in trees or other not in trees:
            continue
        looked = near[:_LOOKED_AT]
        touch = [i for i in looked if _meet(places[i], one, other, trees, points)]
        if not touch:
            apart.append((one, other))
        elif (home is not None and 0 in touch) or len(touch) * len(near) > _ALWAYS * _POSTURES * len(looked):
            joined.append((one, other))
    return apart, joined


def _pairs(parts: Sequence[str]) -> Iterator[tuple[str, str]]:
    for i, one in enumerate(parts):
        for other in parts[i + NEXT_THAT_CAN_TOUCH :]:
            yield one, other


def _thinned(points: Array, rng: np.random.Generator) -> Array:
    if len(points) <= _MOST_POINTS:
        return points
    return points[rng.choice(len(points), _MOST_POINTS, replace=False)]


def _places(model: mujoco.MjModel, q: Array, bodies: Mapping[str, str]) -> dict[str, tuple[Array, Array]]:
    """Place and axes of each part's body at joint positions q (n,) [rad]."""
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_kinematics(model, data)
    found = {}
    for part, body in bodies.items():
        i = model.body(body).id
        found[part] = (data.xpos[i].copy(), data.xmat[i].reshape(3, 3).copy())
    return found


def _overlap(
    places: Mapping[str, tuple[Array, Array]],
    one: str,
    other: str,
    capsules: Mapping[str, Sequence[Capsule]],
) -> bool:
    (p, R), (p2, R2) = places[one], places[other]
    return any(
        segment_distance_squared(*(p + a.ends @ R.T), *(p2 + b.ends @ R2.T)) < (a.radius + b.radius) ** 2
        for a in capsules[one]
        for b in capsules[other]
    )


def _meet(
    places: Mapping[str, tuple[Array, Array]],
    one: str,
    other: str,
    trees: "Mapping[str, cKDTree]",
    points: Mapping[str, Array],
) -> bool:
    """Whether the surfaces come as near to each other as their points stand for."""
    (p, R), (p2, R2) = places[one], places[other]
    seen = (points[other] @ R2.T + p2 - p) @ R
    distance, _ = trees[one].query(seen, distance_upper_bound=SPACING_M)
    return bool(np.isfinite(distance).any())
