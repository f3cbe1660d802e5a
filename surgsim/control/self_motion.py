"""The self-motion manifold at a tip position, and the largest manipulability on it.

Self-motion is all joint motion that moves neither the tip nor, with a trocar, the shaft axis. It has n - 3
degrees, n - 5 with a trocar. Of an arm of seven joints these are the elbow swivel and the instrument's roll,
which leaves mu as it is.
"""

from dataclasses import dataclass

import numpy as np

from surgsim.array import Array
from surgsim.control.manifold import (
    CLIMB_STEPS,
    CLIMB_TOLERANCE_RAD,
    PROJECTION_STEPS,
    Manifold,
    climb,
    climb_from,
    fill_constraints,
    is_inside,
    project,
)
from surgsim.control.manipulability import manipulability
from surgsim.models.arm import ArmModel, Kinematics
from surgsim.spatial import cross, unit
from surgsim.tick.algebra import null_space
from surgsim.tick.arrays import Model, new
from surgsim.tick.nominal import kinematics

MARGIN_RAD = 0.002
"""Distance that self-motion keeps from the joint limits."""
_AT_REST = np.zeros(3)
_SEARCH_SEED = 20_240_917


@dataclass(frozen=True, kw_only=True)
class SelfMotionPoint:
    """A configuration on the manifold.

    Attributes:
        q: Joint positions (n,) [rad].
        miss: Norm of what the constraints lack [m].
        mu: Manipulability of the 3xn tip Jacobian.
        kin: Kinematics at `q`.
    """

    q: Array
    miss: float
    mu: float
    kin: Kinematics


class SelfMotion:
    """Self-motion of the nominal arm at given tip and trocar positions.

    Args:
        arm: The nominal arm.
        margin_rad: Distance kept from the joint limits [rad].
    """

    def __init__(self, arm: ArmModel, margin_rad: float = MARGIN_RAD) -> None:
        self._arm = arm
        self._model = new(Model, arm.limits.q_min.size)
        arm.point(self._model, shared=True)
        self._low = arm.limits.q_min + margin_rad
        self._high = arm.limits.q_max - margin_rad

    def project(
        self, q: Array, p_WT: Array, p_WC: Array | None, steps: int = PROJECTION_STEPS
    ) -> SelfMotionPoint:
        """The point of the manifold near `q` (n,) [rad]: Newton steps of least joint motion.

        Raises:
            numpy.linalg.LinAlgError: If the arm is singular there.
        """
        q = np.array(q, dtype=np.float64)
        ranked, miss = project(self._model, self._on(p_WT, p_WC), q, steps)
        return self._point(q, ranked, miss)

    def climb(
        self,
        q: Array,
        p_WT: Array,
        p_WC: Array | None,
        *,
        steps: int = CLIMB_STEPS,
        tolerance_rad: float = CLIMB_TOLERANCE_RAD,
    ) -> SelfMotionPoint:
        """The local maximum of mu that is reached from `q` (n,) [rad] by self-motion inside the limits.

        Raises:
            numpy.linalg.LinAlgError: If the arm is singular on the way.
        """
        q = np.array(q, dtype=np.float64)
        ranked, miss, _ = climb(self._model, self._on(p_WT, p_WC), q, steps, tolerance_rad)
        return self._point(q, ranked, miss)

    def optima(
        self, here: SelfMotionPoint, p_WT: Array, p_WC: Array | None, starts: int
    ) -> list[SelfMotionPoint]:
        """Local maxima of mu that can be reached from `here` by self-motion inside the limits.

        Climbs from `here` and from `starts` random configurations around it (the same ones every time), and
        keeps those that stepping along the joint-space line, each time back on the manifold, arrives at.

        Raises:
            numpy.linalg.LinAlgError: If the arm is singular uphill of `here`.
        """
        first = self.climb(here.q, p_WT, p_WC)
        found = [first] if self.inside(first) else []
        on = self._on(p_WT, p_WC)
        for offset in search_offsets(starts, self._arm):
            goal = np.empty(here.q.size)
            counts, miss, _ = climb_from(self._model, on, here.q, here.mu, offset, goal)
            if counts:
                found.append(self._point(goal, True, miss))
        return found

    def inside(self, point: SelfMotionPoint) -> bool:
        """Whether `point` is on the manifold and inside the joint limits."""
        return bool(is_inside(self._on(_AT_REST, None), point.q, point.miss))

    def _on(self, p_WT: Array, p_WC: Array | None) -> Manifold:
        tip = np.array(p_WT, dtype=np.float64)
        port = tip if p_WC is None else np.array(p_WC, dtype=np.float64)
        return Manifold(rows=3 if p_WC is None else 5, p_WT=tip, p_WC=port, low=self._low, high=self._high)

    def _point(self, q: Array, ranked: bool, miss: float) -> SelfMotionPoint:
        if not ranked:
            raise np.linalg.LinAlgError("Singular matrix")
        kin = self._arm.kinematics(q)
        return SelfMotionPoint(q=q, miss=miss, mu=manipulability(kin.Jv_WT), kin=kin)

    def swivel_curve(
        self, q: Array, p_WT: Array, p_WC: Array, step_rad: float = 0.02, most: int = 2000
    ) -> list[SelfMotionPoint]:
        """The elbow-swivel curve through `q` with the shaft in the trocar, inside the joint limits.

        Walks the one-dimensional manifold that is left without the instrument's roll, both ways, to a joint
        limit, a singularity or once around. Points are `step_rad` of joint motion apart, in order.
        """
        here = self.project(q, p_WT, p_WC)
        forward, closed = self._walk(here, p_WT, p_WC, 1.0, step_rad, most)
        backward = [] if closed else self._walk(here, p_WT, p_WC, -1.0, step_rad, most)[0]
        return [*reversed(backward), here, *forward]

    def _walk(
        self, here: SelfMotionPoint, p_WT: Array, p_WC: Array, sign: float, step_rad: float, most: int
    ) -> tuple[list[SelfMotionPoint], bool]:
        """Points after `here` in one direction, and whether the curve closed."""
        points: list[SelfMotionPoint] = []
        last, way = here, sign * self._swivel(here, p_WT, p_WC)
        for count in range(most):
            point = self.project(last.q + step_rad * way, p_WT, p_WC)
            if not self.inside(point) or np.linalg.norm(point.q - last.q) > 3.0 * step_rad:
                break
            if count > 10 and np.linalg.norm(point.q - here.q) < 0.75 * step_rad:
                return points, True
            turn = self._swivel(point, p_WT, p_WC)
            last, way = point, turn if turn @ way > 0.0 else -turn
            points.append(point)
        return points, False

    def _swivel(self, point: SelfMotionPoint, p_WT: Array, p_WC: Array) -> Array:
        """Unit joint direction (n,) of self-motion without the instrument's roll."""
        n = point.q.size
        rows, left = np.empty((6, n)), np.empty((n - 6, n))
        kinematics(self._model, point.q)
        fill_constraints(self._model, self._on(p_WT, p_WC), rows[:5], np.empty(5))
        rows[5] = np.eye(n)[n - 1]
        null_space(rows, left)
        way: Array = left[-1]
        return way


def elbow_swivel_rad(kin: Kinematics) -> float:
    """Angle of the elbow about the line from shoulder to wrist [rad], 0 where the elbow is highest."""
    shoulder, elbow, wrist = kin.anchors_W[1], kin.anchors_W[3], kin.anchors_W[5]
    axis = unit(wrist - shoulder)
    up = np.array([0.0, 0.0, 1.0])
    up = unit(up - axis * (axis @ up))
    out = elbow - shoulder
    return float(np.arctan2(cross(axis, up) @ out, up @ out))


def search_offsets(starts: int, arm: ArmModel) -> Array:
    """Random joint displacements (starts, n) [rad] to begin a search from, the same ones every time.

    A last joint that only rolls the instrument stays: mu does not depend on it.
    """
    offsets = np.random.default_rng(_SEARCH_SEED).normal(size=(starts, arm.limits.q_min.size))
    if arm.rolls_shaft:
        offsets[:, -1] = 0.0
    return offsets
