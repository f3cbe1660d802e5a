"""mink: the differential inverse kinematics library, with the RCM as hard rows."""

from typing import Literal

import mink
import numpy as np
from numpy.typing import NDArray
from pydantic import NonNegativeFloat, PositiveFloat

from surgsim.catalog import PartConfig
from surgsim.control.failure import ControlFailure
from surgsim.control.mink_tasks import RcmTask
from surgsim.control.problem import Resolution, VelocityProblem, bounded_resolution, stacked_rows
from surgsim.errors import Outcome
from surgsim.models.arm import ArmModel
from surgsim.models.robot import joint_names

Array = NDArray[np.float64]


class MinkConfig(PartConfig):
    """mink's solve_ik: tip as a weighted task, RCM as hard rows, its own limits.

    Attributes:
        k_tip: Tip feedback gain [1/s].
        k_rcm: RCM feedback gain [1/s].
        tip_cost: Weight of the tip's task.
        damping: Weight of the joint displacement.
        position_gain_per_s: How fast a joint may approach its position limit [1/s].
    """

    type: Literal["mink"] = "mink"
    k_tip: NonNegativeFloat = 5.0
    k_rcm: NonNegativeFloat = 5.0
    tip_cost: PositiveFloat = 1.0
    damping: PositiveFloat = 1e-9
    position_gain_per_s: PositiveFloat = 10.0

    def build(self, arm: ArmModel) -> "Mink":
        """The resolver."""
        return Mink(self, arm)


class Mink:
    """mink 1.x: min |J_T dq - T v_d|^2 + damping |dq|^2 subject to J_rcm dq = T v_rcm and limits on dq.

    The feed-forward enters as a target one period ahead, the feedback gains as in `stacked_rows`, so that
    mink solves the same problem as the other resolvers. Source: mink's documentation of `solve_ik`.
    """

    def __init__(self, config: MinkConfig, arm: ArmModel) -> None:
        self._c = config
        model = arm.scene.model
        self._configuration = mink.Configuration(model)
        self._tip = mink.FrameTask("tip", "site", position_cost=config.tip_cost, orientation_cost=0.0)
        self._rcm = RcmTask(arm.scene.tip_site, model.nv)
        speeds = dict(zip(joint_names(model), arm.limits.velocity.tolist(), strict=True))
        self._model = model
        self._velocity_limit = mink.VelocityLimit(model, speeds)
        self._limits: tuple[mink.Limit, ...] = ()
        self._limits_dt_s = 0.0

    def start(self, problem: VelocityProblem) -> None:
        """The resolver has no state."""

    def step(self, problem: VelocityProblem, memory: None) -> tuple[Resolution, None]:
        """Joint velocities for one period."""
        J, v = stacked_rows(problem, self._c.k_tip, self._c.k_rcm)
        dt, configuration = problem.dt_s, self._configuration
        configuration.update(problem.q)
        self._tip.set_target(mink.SE3.from_translation(problem.kin.p_WT + dt * v[:3]))
        try:
            qdot = mink.solve_ik(
                configuration,
                [self._tip],
                dt,
                "daqp",
                self._c.damping,
                limits=self._limits_for(dt),
                constraints=self._hard_rows(problem, v),
            )
        except mink.NoSolutionFound as error:
            raise ControlFailure(
                Outcome.INFEASIBLE, "mink found no velocity that meets RCM and limits", {"J": J, "v": v}
            ) from error
        return bounded_resolution(problem, np.asarray(qdot), J, v), None

    def _limits_for(self, dt_s: float) -> tuple[mink.Limit, ...]:
        """Limits for a control period, as mink wants them; making them takes as long as its solver."""
        if dt_s != self._limits_dt_s:
            gain = min(1.0, self._c.position_gain_per_s * dt_s)
            self._limits = (self._velocity_limit, mink.ConfigurationLimit(self._model, gain=gain))
            self._limits_dt_s = dt_s
        return self._limits

    def _hard_rows(self, problem: VelocityProblem, v: Array) -> list[RcmTask] | None:
        """The RCM rows, aimed so that J_rcm dq = T v_rcm."""
        if problem.rcm is None:
            return None
        wanted = problem.dt_s * v[3:]  # the row reads J dq = -N (p - target)
        shift = problem.rcm.error + wanted
        self._rcm.target = problem.p_WC + problem.rcm.normals.T @ shift
        return [self._rcm]
