"""Looks for contact between arms: of any capsule of the one with any of the other, instruments included."""

from collections.abc import Sequence
from itertools import combinations
from typing import Any, ClassVar

import mujoco
import numpy as np
from numba import types

from surgsim.compiled import as_parameter, compiled
from surgsim.models.build import Scene
from surgsim.plant.contacts import INEXACT_M, NOTHING, reaches, touching_pair
from surgsim.tick.arrays import Record, new, type_of
from surgsim.tick.views import vector, words


class Between(Record):
    """The capsules of all arms, and how much room there was between the arms when last looked at.

    The first nine fields are as in `surgsim.plant.contacts.Watch`.

    Attributes:
        xpos: Address of the body places.
        xmat: Of the body orientations.
        bodies: Of the bodies that the capsules are fixed to.
        local: Of their end points in the body's frame (count, 2, 3) [m].
        radii: Of their radii [m].
        pairs: Of the capsules that can touch each other (pair_count, 2).
        ends: Of the end points, world frame (count, 2, 3) [m]; filled.
        nbody: Bodies.
        count: Capsules.
        pair_count: Pairs.
        qpos: Address of all positions.
        places: Where the arms' joints are in them (joints,).
        seen: Of the joints' positions at the last look (joints,) [rad].
        reach: Of how far from its axis a capsule can be, for each joint (joints,) [m].
        nq: Positions.
        joints: Joints of all arms.
        clearance: Room at the last look [m].
    """

    ADDRESSES: ClassVar[frozenset[str]] = frozenset(
        ("xpos", "xmat", "bodies", "local", "radii", "pairs", "ends", "qpos", "places", "seen", "reach")
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
    qpos: int
    places: int
    seen: int
    reach: int
    nq: int
    joints: int
    clearance: float


@compiled
def arms_are_clear(between: Between) -> bool:
    """Whether no arm touches another.

    A point of an arm moves by at most sum_i L_i |dq_i|, with the reaches L, and two arms come nearer by at
    most the sum over the joints of both. All is looked at again only when the room that there was could be
    used up.
    """
    b = between
    qpos, places = vector(b.qpos, b.nq), words(b.places, b.joints)
    seen, reach, used = vector(b.seen, b.joints), vector(b.reach, b.joints), 0.0
    for i in range(b.joints):
        used += reach[i] * abs(qpos[places[i]] - seen[i])
    if used < b.clearance:
        return True
    _, other, _, room = touching_pair(b)
    b.clearance = room - INEXACT_M
    for i in range(b.joints):
        seen[i] = qpos[places[i]]
    return other == NOTHING


class ArmsWatch:
    """Distances between the arms where their bodies now are; nothing is pushed apart.

    Args:
        arms: Name and scene of each arm.
        data: MuJoCo's data, which must outlive it.
        stopping: Arms for which contact ends a run; two of them are looked at if it does for both.

    Attributes:
        record: What the kernel `arms_are_clear` works on.
        seen: Joint positions at the last look, of all arms [rad].
    """

    def __init__(
        self, arms: Sequence[tuple[str, Scene]], data: mujoco.MjData, stopping: frozenset[str]
    ) -> None:
        scenes = [scene for _, scene in arms]
        self._names = [f"{name}'s {part}" for name, scene in arms for part in scene.shapes.names]
        counts = [len(scene.shapes.names) for scene in scenes]
        first = np.cumsum([0, *counts])
        pairs = [
            (first[a] + i, first[b] + j)
            for a, b in combinations(range(len(arms)), 2)
            if {arms[a][0], arms[b][0]} <= stopping
            for i in range(counts[a])
            for j in range(counts[b])
        ]
        joints = np.concatenate([scene.qpos_ids for scene in scenes]).astype(np.int64)
        self.seen = np.zeros(len(joints))
        self._kept: dict[str, Any] = {
            "xpos": data.xpos,
            "xmat": data.xmat,
            "bodies": np.concatenate([scene.shapes.bodies for scene in scenes]).astype(np.int64),
            "local": np.concatenate([scene.shapes.ends for scene in scenes]),
            "radii": np.concatenate([scene.shapes.radii for scene in scenes]),
            "pairs": np.array(pairs, dtype=np.int64).reshape(-1, 2),
            "ends": np.zeros((int(first[-1]), 2, 3)),
            "qpos": data.qpos,
            "places": joints,
            "seen": self.seen,
            "reach": np.concatenate([reaches(scene) for scene in scenes]),
        }
        self.record = b = new(Between, 0)
        for name, array in self._kept.items():
            b[name] = array.ctypes.data
        b.nbody, b.count, b.pair_count = scenes[0].model.nbody, int(first[-1]), len(pairs)
        b.nq, b.joints = scenes[0].model.nq, len(joints)
        self._touching = as_parameter(touching_pair, _looking_signature())

    def look(self) -> str | None:
        """The first contact between two arms, in words, or None."""
        a, b, depth, _ = self._touching(self.record)
        return (
            None if b == NOTHING else f"{self._names[a]} touches {self._names[b]}, {1e3 * depth:.1f} mm deep"
        )


def _looking_signature() -> Any:
    found: Any = types.Tuple((types.int64, types.int64, types.float64, types.float64))  # type: ignore[no-untyped-call]
    return found(type_of(Between, 0))
