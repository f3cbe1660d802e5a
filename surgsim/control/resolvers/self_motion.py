"""Self-motion optimum: go to the most manipulable posture as fast as the joints allow, then stay on it."""

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, NonNegativeFloat

from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.control.failure import ControlFailure
from surgsim.control.manipulability import velocity_product_accelerations
from surgsim.control.null_space import least_velocity
from surgsim.control.problem import (
    Resolution,
    VelocityProblem,
    bounded_resolution,
    braking_bounds,
    stacked_rows,
)
from surgsim.control.qp import DenseQp
from surgsim.control.rcm import rcm_bias_acceleration
from surgsim.control.self_motion import SelfMotion, SelfMotionPoint
from surgsim.errors import Outcome
from surgsim.models.arm import ArmModel
from surgsim.models.build import JointLimits

Array = NDArray[np.float64]
_HORIZON_S = 10.0
_REHEARSAL_S = 0.02


class SelfMotionConfig(PartConfig):
    """Tracks the self-motion optimum of the manipulability at the joints' velocity and acceleration limits.

    Attributes:
        k_tip: Tip feedback gain [1/s], at most one over the control period.
        k_rcm: RCM feedback gain [1/s].
        acceleration_share: Share of the acceleration limits that self-motion may plan with.
        search_starts: Random starts of the search for the optimum before the first step; 0 climbs from the
            start configuration alone.
    """

    needs_redundancy: ClassVar[int] = 1
    type: Literal["self_motion"] = "self_motion"
    k_tip: NonNegativeFloat = 5.0
    k_rcm: NonNegativeFloat = 5.0
    acceleration_share: Annotated[float, Field(gt=0.0, le=1.0)] = 0.9
    search_starts: Annotated[int, Field(ge=0, le=1000)] = 24

    def build(self, arm: ArmModel) -> "SelfMotionOptimum":
        """The resolver."""
        return SelfMotionOptimum(self, arm)


@dataclass(frozen=True, slots=True, kw_only=True)
class SelfMotionMemory:
    """State of the resolver.

    Attributes:
        optimum: Joint positions (n,) of the optimum that is tracked [rad].
        qdot: Joint velocity of the last step (n,) [rad/s].
    """

    optimum: Array
    qdot: Array


class SelfMotionOptimum:
    """Ours. Keeps an estimate z of the optimum on the self-motion manifold, and drives the arm to it.

    Each step projects z on the manifold of the coming tip position and takes one Newton step of ln(mu) there.
    The arm's null-space motion follows the straight joint-space line to z, all joints in step, at the speed
    from which the joints can still stop at z: q'_i <= sqrt((a T)^2 + 2 a d_i) - a T. The QP

        min |q' - q'_z|^2  subject to  J q' = b,  Omega,  acceleration and braking bounds

    keeps tip and RCM exact. b holds the second-order term of the step, so that a whole period of motion ends
    on the path and not on its tangent:

        b = v_d + T/2 (a_d - J' q') - k e
    """

    def __init__(self, config: SelfMotionConfig, arm: ArmModel) -> None:
        self._c = config
        self._arm = arm
        self._manifold = SelfMotion(arm)
        self._qp = DenseQp()

    def start(self, problem: VelocityProblem) -> SelfMotionMemory:
        """Search the optimum that can be reached from here; forget the active set."""
        self._qp = DenseQp()
        return SelfMotionMemory(optimum=self._search(problem), qdot=problem.v.copy())

    def step(self, problem: VelocityProblem, memory: SelfMotionMemory) -> tuple[Resolution, SelfMotionMemory]:
        """Joint velocities for one period."""
        optimum = self._track(problem, memory.optimum)
        J, v = stacked_rows(problem, self._c.k_tip, self._c.k_rcm)
        wanted = self._towards(problem, J, optimum, memory.optimum)
        lower, upper = braking_bounds(problem, memory.qdot)
        qdot = memory.qdot
        for _ in range(2):
            rhs = v + 0.5 * problem.dt_s * self._second_order(problem, qdot)
            qdot = self._solve(problem, J, rhs, wanted, lower, upper)
        return bounded_resolution(problem, qdot, J, rhs), SelfMotionMemory(optimum=optimum, qdot=qdot)

    def _second_order(self, problem: VelocityProblem, qdot: Array) -> Array:
        """a_d - J' q' of the rows (3 or 5,) [m/s^2]."""
        linear, angular = velocity_product_accelerations(problem.kin, qdot)
        tip = problem.command.a_WTd - linear
        if problem.rcm is None:
            return tip
        shaft = rcm_bias_acceleration(problem.kin, qdot, problem.p_WC, problem.v_WC, linear, angular)
        return np.concatenate((tip, -shaft))

    def _solve(
        self, problem: VelocityProblem, J: Array, rhs: Array, wanted: Array, lower: Array, upper: Array
    ) -> Array:
        qdot = least_velocity(J, rhs, wanted)
        if (qdot >= lower).all() and (qdot <= upper).all():
            return qdot
        eye = np.eye(wanted.size)
        for low, high in ((lower, upper), (problem.lower, problem.upper)):
            found = self._qp.solve(eye, -wanted, low, high, J, rhs, rhs)
            if found is not None:
                return found
        raise ControlFailure(
            Outcome.INFEASIBLE,
            "self-motion: no joint velocity inside Omega meets the task rows",
            {"J": J, "rhs": rhs, "lower": problem.lower, "upper": problem.upper},
        )

    def _towards(self, problem: VelocityProblem, J: Array, optimum: Array, last_optimum: Array) -> Array:
        """Velocity (n,) [rad/s] along the line to the optimum, and the optimum's own velocity.

        Slowed where following the manifold's curvature at that speed would take more than the share of the
        joints' acceleration.
        """
        drift = (optimum - last_optimum) / problem.dt_s
        acceleration = self._c.acceleration_share * problem.limits.acceleration
        approach = _approach(optimum - problem.q, acceleration, problem.limits.velocity, problem.dt_s)
        at_rest = np.zeros_like(approach)
        centripetal = self._second_order(problem, approach) - self._second_order(problem, at_rest)
        turn = least_velocity(J, centripetal)
        worst = float(np.max(np.abs(turn) / acceleration))
        return np.asarray(approach / max(1.0, worst**0.5) + drift)

    def _track(self, problem: VelocityProblem, optimum: Array) -> Array:
        """The optimum (n,) for the tip position at the end of this step."""
        T, command = problem.dt_s, problem.command
        p_next = command.p_WTd + T * command.v_WTd + 0.5 * T * T * command.a_WTd
        p_WC = problem.p_WC if problem.rcm is not None else None
        point = self._manifold.project(optimum, p_next, p_WC, steps=3)
        return point.q + self._manifold.improve(point, p_next, p_WC, radius=0.05)

    def _search(self, problem: VelocityProblem) -> Array:
        """Among the local optima that can be reached, the one of the largest gain, the way there included."""
        p, p_WC = problem.command.p_WTd, problem.p_WC if problem.rcm is not None else None
        here = self._manifold.project(problem.q, p, p_WC)
        best, most = here, 0.0
        for goal in self._manifold.optima(here, p, p_WC, self._c.search_starts):
            gain = self._rehearse(problem.limits, here, goal, p, p_WC)
            if gain > most:
                best, most = goal, gain
        return best.q

    def _rehearse(
        self, limits: JointLimits, here: SelfMotionPoint, goal: SelfMotionPoint, p: Array, p_WC: Array | None
    ) -> float:
        """Integral of the gain in mu [s] over the next ten seconds, on the way to `goal` and there."""
        acceleration = self._c.acceleration_share * limits.acceleration
        q, gain, last = here.q, 0.0, 0.0
        for k in range(round(_HORIZON_S / _REHEARSAL_S)):
            way = _approach(goal.q - q, acceleration, limits.velocity, _REHEARSAL_S)
            speed = float(np.max(np.abs(way) / acceleration))
            allowed = min(speed, last + _REHEARSAL_S)
            point = self._manifold.project(
                q + way * (_REHEARSAL_S * allowed / max(speed, 1e-12)), p, p_WC, steps=3
            )
            q, last = point.q, allowed
            gain += (point.mu - here.mu) * _REHEARSAL_S
            if np.max(np.abs(goal.q - q)) < 0.02:
                return gain + (goal.mu - here.mu) * (_HORIZON_S - (k + 1) * _REHEARSAL_S)
        return gain


@compiled
def _approach(distance: Array, a: Array, v_max: Array, dt: float) -> Array:
    """Velocity along `distance` (n,) at which every joint can still stop at its end."""
    scale = np.inf
    for i in range(distance.size):
        d = abs(distance[i])
        if d > 1e-12:
            reach = a[i] * dt
            speed = min(v_max[i], np.sqrt(reach * reach + 2.0 * a[i] * d) - reach, d / dt)
            scale = min(scale, speed / d)
    return distance * (scale if scale < np.inf else 0.0)
