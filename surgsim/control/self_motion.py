"""The self-motion manifold at a tip position, and the largest manipulability on it.

Self-motion is all joint motion that moves neither the tip nor, with a trocar, the shaft axis. It has n - 3
degrees, n - 5 with a trocar. Of an arm of seven joints these are the elbow swivel and the instrument's roll,
which leaves mu as it is.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from surgsim.control.manipulability import log_manipulability_gradient, manipulability
from surgsim.control.qp import DenseQp
from surgsim.control.rcm import rcm_kinematics
from surgsim.models.arm import ArmModel, Kinematics
from surgsim.spatial import cross, unit

Array = NDArray[np.float64]
_AT_REST = np.zeros(3)


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

    def __init__(self, arm: ArmModel, margin_rad: float = 0.002) -> None:
        self._arm = arm
        self._low = arm.limits.q_min + margin_rad
        self._high = arm.limits.q_max - margin_rad

    def rows(self, kin: Kinematics, p_WT: Array, p_WC: Array | None) -> tuple[Array, Array]:
        """Constraint Jacobian (3 or 5, n) and residual (3 or 5,) [m] for tip and trocar positions."""
        residual = kin.p_WT - p_WT
        if p_WC is None:
            return kin.Jv_WT, residual
        rcm = rcm_kinematics(kin, p_WC, _AT_REST)
        return np.concatenate((kin.Jv_WT, rcm.jacobian)), np.concatenate((residual, rcm.error))

    def project(self, q: Array, p_WT: Array, p_WC: Array | None, steps: int = 8) -> SelfMotionPoint:
        """The point of the manifold near `q` (n,) [rad]: Newton steps of least joint motion."""
        kin = self._arm.kinematics(q)
        J, residual = self.rows(kin, p_WT, p_WC)
        for _ in range(steps):
            if residual @ residual < 1e-24:
                break
            q = q - J.T @ np.linalg.solve(J @ J.T, residual)
            kin = self._arm.kinematics(q)
            J, residual = self.rows(kin, p_WT, p_WC)
        return SelfMotionPoint(
            q=q, miss=float(np.linalg.norm(residual)), mu=manipulability(kin.Jv_WT), kin=kin
        )

    def improve(self, point: SelfMotionPoint, p_WT: Array, p_WC: Array | None, radius: float) -> Array:
        """Joint displacement (n,) [rad] towards larger mu, tangent to the manifold, inside the limits.

        A Newton step on ln(mu) with the curvature of the manifold through the Lagrangian, its eigenvalues
        made positive, at most `radius` [rad] long.
        """
        J, _ = self.rows(point.kin, p_WT, p_WC)
        gradient = log_manipulability_gradient(point.kin.Jv_WT, point.kin.z_W)
        Z: Array = np.asarray(np.linalg.qr(J.T, mode="complete")[0][:, len(J) :], dtype=np.float64)
        multiplier = np.linalg.solve(J @ J.T, J @ gradient)
        curvature: Array = -Z.T @ self._slopes(point.q, Z, np.asarray(multiplier), p_WT, p_WC)
        eigenvalues, V = np.linalg.eigh(0.5 * (curvature + curvature.T))
        w: Array = np.maximum(np.abs(eigenvalues), 0.05)
        reduced = Z.T @ gradient
        step: Array = Z @ (V @ ((V.T @ reduced) / w))
        length = float(np.linalg.norm(step))
        step = step * min(1.0, radius / max(length, 1e-12))
        if (point.q + step >= self._low).all() and (point.q + step <= self._high).all():
            return step
        return self._bounded_step(point.q, Z, np.asarray(V * w @ V.T), reduced, radius)

    def _slopes(self, q: Array, Z: Array, multiplier: Array, p_WT: Array, p_WC: Array | None) -> Array:
        """Derivative of grad(ln mu) - J^T multiplier along the columns of Z (n, k), central differences."""
        slopes = np.empty(Z.shape)
        for k in range(Z.shape[1]):
            ends = []
            for sign in (1.0, -1.0):
                kin = self._arm.kinematics(q + sign * _DIFFERENCE_RAD * Z[:, k])
                J, _ = self.rows(kin, p_WT, p_WC)
                ends.append(log_manipulability_gradient(kin.Jv_WT, kin.z_W) - J.T @ multiplier)
            slopes[:, k] = (ends[0] - ends[1]) / (2.0 * _DIFFERENCE_RAD)
        return slopes

    def _bounded_step(self, q: Array, Z: Array, B: Array, reduced: Array, radius: float) -> Array:
        """The step inside joint limits and a box of `radius`; zero if there is none."""
        box = np.full(len(reduced), radius)
        y = DenseQp().solve(0.5 * (B + B.T), -reduced, -box, box, Z, self._low - q, self._high - q)
        return np.zeros_like(q) if y is None else Z @ y

    def climb(
        self, q: Array, p_WT: Array, p_WC: Array | None, *, steps: int = 60, tolerance_rad: float = 1e-9
    ) -> SelfMotionPoint:
        """The local maximum of mu that is reached from `q` (n,) [rad] by self-motion inside the limits."""
        point = self.project(q, p_WT, p_WC)
        radius = 0.3
        for _ in range(steps):
            step = self.improve(point, p_WT, p_WC, radius)
            if step @ step < tolerance_rad**2:
                break
            trial = self.project(np.clip(point.q + step, self._low, self._high), p_WT, p_WC)
            if self._is_better(trial, point):
                point, radius = trial, min(2.0 * radius, 0.3)
            else:
                radius *= 0.25
                if radius < tolerance_rad:
                    break
        return point

    def optima(
        self, here: SelfMotionPoint, p_WT: Array, p_WC: Array | None, starts: int
    ) -> list[SelfMotionPoint]:
        """Local maxima of mu that can be reached from `here` by self-motion inside the limits.

        Climbs from `here` and from `starts` random configurations around it (the same ones every time), and
        keeps what `reaches` confirms.
        """
        rng = np.random.default_rng(_SEARCH_SEED)
        first = self.climb(here.q, p_WT, p_WC)
        found = [first] if self.inside(first) else []
        for _ in range(starts):
            guess = np.clip(here.q + rng.normal(size=here.q.size), self._low, self._high)
            if self._arm.rolls_shaft:
                guess[-1] = here.q[-1]
            point = self.climb(guess, p_WT, p_WC)
            if self.inside(point) and self.reaches(here, point, p_WT, p_WC):
                found.append(point)
        return found

    def _is_better(self, trial: SelfMotionPoint, point: SelfMotionPoint) -> bool:
        """Whether `trial` has a larger mu inside the limits, or is nearer to their inside."""
        outside = self._outside(point)
        if outside > 1e-6:
            return trial.miss < 1e-8 and self._outside(trial) < 0.9 * outside
        return trial.mu > point.mu and self.inside(trial)

    def _outside(self, point: SelfMotionPoint) -> float:
        """How far the worst joint is outside its range [rad]."""
        return float(np.max(np.maximum(np.maximum(self._low - point.q, point.q - self._high), 0.0)))

    def inside(self, point: SelfMotionPoint) -> bool:
        """Whether `point` is on the manifold and inside the joint limits."""
        return self._outside(point) <= 1e-6 and point.miss < 1e-8

    def reaches(self, here: SelfMotionPoint, goal: SelfMotionPoint, p_WT: Array, p_WC: Array | None) -> bool:
        """Whether stepping along the joint-space line to `goal`, each time back on the manifold, arrives.

        A path that comes near a singularity (mu below half of where it began) does not count.
        """
        q, lowest = here.q, 0.5 * min(here.mu, goal.mu)
        for left in range(40, 0, -1):
            point = self.project(q + (goal.q - q) / left, p_WT, p_WC, steps=4)
            if point.miss > 1e-4 or point.mu < lowest:
                return False
            q = point.q
        return bool(np.max(np.abs(q - goal.q)) < 0.1)

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
        J, _ = self.rows(point.kin, p_WT, p_WC)
        return np.asarray(np.linalg.qr(np.vstack([J, np.eye(point.q.size)[-1]]).T, mode="complete")[0][:, -1])


def elbow_swivel_rad(kin: Kinematics) -> float:
    """Angle of the elbow about the line from shoulder to wrist [rad], 0 where the elbow is highest.

    Of an arm of seven joints in the usual order: joints 2, 4 and 6 are in shoulder, elbow and wrist.
    """
    shoulder, elbow, wrist = kin.anchors_W[1], kin.anchors_W[3], kin.anchors_W[5]
    axis = unit(wrist - shoulder)
    up = np.array([0.0, 0.0, 1.0])
    up = unit(up - axis * (axis @ up))
    out = elbow - shoulder
    return float(np.arctan2(cross(axis, up) @ out, up @ out))


_DIFFERENCE_RAD = 1e-4
_SEARCH_SEED = 20_240_917
