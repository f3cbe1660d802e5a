"""The nominal arm with its shaft in the trocar: configurations for a place of the tip, and paths followed."""

from dataclasses import dataclass, replace

import numpy as np

from surgsim.array import Array
from surgsim.control.manifold import Manifold
from surgsim.control.rcm import rcm_kinematics
from surgsim.models.arm import RCM_ROWS, ArmModel
from surgsim.models.collision import collision_shapes
from surgsim.models.config import SceneConfig
from surgsim.plant.contacts import ContactWatch
from surgsim.simulate.following import Path, follow, improve_start, settle, whole_turns
from surgsim.spatial import unit
from surgsim.tick.arrays import Model, new

LIMIT_MARGIN_RAD = 0.01
"""Distance that a start and its path keep from the joint limits."""
CLEARANCE_M = 0.005
"""Distance that a start and path that are searched for keep between arm, patient and table."""
_ANYWHERE = 1e9
_ENOUGH = -1e9


@dataclass(frozen=True, kw_only=True)
class Start:
    """A start of a path.

    Attributes:
        q: Joint positions (n,) [rad].
        worth: What it is worth, see `surgsim.simulate.following.follow`.
        room_rad: Smallest distance of any joint from its limits on the path, negative past one; minus
            infinity where the path is not followed to its end [rad].
    """

    q: Array
    worth: float
    room_rad: float


@dataclass(frozen=True, kw_only=True)
class Followed:
    """How far a path was followed.

    Attributes:
        reached: How many of its places, in order.
        q: Joint positions at the last place that was tried (n,) [rad].
    """

    reached: int
    q: Array


class Reach:
    """Inverse kinematics of the nominal arm with the shaft in the trocar.

    Args:
        arm: The nominal arm; it must outlive this object.
        scene: What the arm is in: the port, if there is one, and with it the patient.
        inside: Whether the joints stay within their limits; else they are free, and only counted.
    """

    def __init__(self, arm: ArmModel, scene: SceneConfig, *, inside: bool = True) -> None:
        self.arm, trocar = arm, scene.trocar
        limits, n = arm.limits, arm.limits.q_min.size
        self.p_WC = None if trocar is None else np.array(trocar.position_m)
        self._axis = None if trocar is None else unit(np.array(trocar.axis))
        self._model = new(Model, n)
        around = replace(arm.scene, shapes=collision_shapes(arm.scene.parts, scene))
        self._watch = ContactWatch(around, arm.point(self._model))
        self._low, self._high = np.array(limits.q_min), np.array(limits.q_max)
        self.joints = n - arm.rolls_shaft
        self._on = Manifold(
            rows=3 + (0 if trocar is None else RCM_ROWS),
            p_WT=np.zeros(3),
            p_WC=np.zeros(3) if self.p_WC is None else self.p_WC.copy(),
            low=self._low + LIMIT_MARGIN_RAD if inside else np.full(n, -_ANYWHERE),
            high=self._high - LIMIT_MARGIN_RAD if inside else np.full(n, _ANYWHERE),
        )

    def path(self, places: Array, *, clear: bool) -> Path:
        """What the methods below take: places (k, 3) [m], and whether contact counts."""
        return Path(
            places=np.ascontiguousarray(places, dtype=np.float64),
            low=self._low,
            high=self._high,
            joints=self.joints,
            clearance_m=CLEARANCE_M if clear else -1.0,
        )

    def settle(self, p_WT: Array, q: Array) -> Array:
        """Joint positions (n,) [rad] near `q`, the tip as near to `p_WT` (3,) [m] as the trocar allows."""
        out = np.array(q, dtype=np.float64)
        self._on.p_WT[:] = p_WT
        settle(self._model, self._on, out)
        return out

    def follow(self, path: Path, q: Array) -> Followed:
        """Follow `path` from `q` (n,) [rad] by least joint motion."""
        end = np.array(q, dtype=np.float64)
        reached = follow(self._model, self._on, self._watch.record, path, end, _ENOUGH)[0]
        return Followed(reached=reached, q=end)

    def start(self, path: Path, q: Array) -> Start:
        """The start of `path` that `q` (n,) [rad] is."""
        end = np.array(q, dtype=np.float64)
        reached, _, room, worth = follow(self._model, self._on, self._watch.record, path, end, _ENOUGH)
        whole = reached == len(path.places)
        return Start(q=np.array(q), worth=worth, room_rad=room if whole else -np.inf)

    def improved(
        self, path: Path, start: Start, directions: Array, lengths: tuple[float, float], most: int
    ) -> Start:
        """The best start of `path` by self-motion around one, see `following.improve_start`."""
        q = start.q.copy()
        arguments = (self._model, self._on, self._watch.record, path, q)
        improve_start(*arguments, start.worth, directions, *lengths, most)
        return self.start(path, q)

    def contact(self, places: Array, q: Array) -> str | None:
        """The first forbidden contact on the way from `q` (n,) [rad] along places (k, 3) [m], in words."""
        here, port = q, np.zeros(3) if self.p_WC is None else self.p_WC
        for place in places:
            here = self.settle(place, here)
            found = self._watch.look(port)
            if found is not None:
                return found.detail
        return None

    def turned_inside(self, path: Path, q: Array) -> Array:
        """`q` (n,) [rad], each joint turned by whole turns to where its path has most room."""
        lowest, highest = self._extent(path, q)
        middle = 0.5 * (lowest + highest)
        turns = [whole_turns(path, j, middle[j]) for j in range(q.size)]
        return np.asarray(q + 2.0 * np.pi * np.array(turns))

    def miss(self, q: Array, p_WT: Array) -> tuple[float, float]:
        """Distance of tip from `p_WT` and of shaft from trocar at `q` [m]."""
        kin = self.arm.kinematics(q)
        rcm = 0.0
        if self.p_WC is not None:
            rcm = float(np.linalg.norm(rcm_kinematics(kin, self.p_WC, np.zeros(3)).error))
        return float(np.linalg.norm(kin.p_WT - p_WT)), rcm

    def points_inwards(self, q: Array) -> bool:
        """Whether the shaft points into the patient at `q` (n,) [rad]: an axis through the trocar may not."""
        return self._axis is None or bool(self.arm.kinematics(q).R_WT[:, 2] @ self._axis < 0.0)

    def near_limit(self, q: Array) -> str:
        """Which joints of `q` are at their position limit, in words."""
        margin = np.minimum(q - self._low, self._high - q)
        at = [f"joint {i + 1}" for i in np.flatnonzero(margin < 2 * LIMIT_MARGIN_RAD)]
        return f"{' and '.join(at)} at the position limit" if at else "no joint at its limit, out of reach"

    def _extent(self, path: Path, q: Array) -> tuple[Array, Array]:
        """Lowest and highest joint positions (n,) [rad] on the path from `q`."""
        here = np.array(q, dtype=np.float64)
        every = [here]
        for place in path.places:
            here = self.settle(place, here)
            every.append(here)
        return np.min(every, axis=0), np.max(every, axis=0)
