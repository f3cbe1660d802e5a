"""mink: the differential inverse kinematics library, with the RCM as hard rows."""

from collections.abc import Callable, Mapping
from typing import ClassVar, Literal

import numpy as np
from pydantic import NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.control.inside import Head
from surgsim.control.resolvers.base import KernelResolver
from surgsim.control.resolvers.rows import answer, fill_task_rows
from surgsim.models.arm import ArmModel
from surgsim.models.robot import joint_names
from surgsim.packages import require
from surgsim.tick.arrays import Record, Resolved, Seen
from surgsim.tick.fields import Fields
from surgsim.tick.mujoco_calls import mj_comPos, mj_kinematics
from surgsim.tick.overlay import laid_over, overlay
from surgsim.tick.python_part import enter
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.status import GOES_ON, INFEASIBLE
from surgsim.tick.views import doubles, vector


class MinkConfig(PartConfig):
    """mink's solve_ik: tip as a weighted task, RCM as hard rows, its own limits.

    Attributes:
        k_tip: Tip feedback gain [1/s].
        k_rcm: RCM feedback gain [1/s].
        tip_cost: Weight of the tip's task.
        damping: Weight of the joint displacement.
        position_gain_per_s: How fast a joint may approach its position limit [1/s].
    """

    shares_null_space: ClassVar[bool] = True
    type: Literal["mink"] = "mink"
    k_tip: NonNegativeFloat = 5.0
    k_rcm: NonNegativeFloat = 5.0
    tip_cost: PositiveFloat = 1.0
    damping: PositiveFloat = 1e-9
    position_gain_per_s: PositiveFloat = 10.0

    def check_installed(self) -> None:
        """Refuse to go without mink.

        Raises:
            MissingPackageError: Where it is not installed.
        """
        require("the resolver 'mink' needs", "mink")

    def build(self, arm: ArmModel) -> KernelResolver:
        """The resolver."""
        self.check_installed()
        solver, gains = MinkSolver(self, arm), np.zeros(LAW_SIZE)
        law, n = laid_over(Law, gains), arm.limits.q_min.size
        law.k_tip, law.k_rcm = self.k_tip, self.k_rcm
        law.mj_model, law.mj_data, law.qpos, law.site_xpos, law.site_xmat, law.end_xpos, law.end_xmat = (
            solver.addresses
        )
        return KernelResolver(
            kernel=mink_velocity,
            arm=arm,
            gains=gains,
            memory_size=_QDOT + n,
            failures={INFEASIBLE: "mink found no velocity that meets RCM and limits"},
            examine=_examine,
            inside=solver,
        )


class Law(Record):
    """Gains of the kernel.

    Attributes:
        head: Where mink is.
        k_tip: Tip feedback gain [1/s].
        k_rcm: RCM feedback gain [1/s].
        mj_model: Address of the model of mink's configuration.
        mj_data: Of its data.
        qpos: Of the joint positions in them.
        site_xpos: Of the tip's place in them.
        site_xmat: Of its orientation.
        end_xpos: Of the place of the shaft's end: the tip's of a straight instrument.
        end_xmat: Of its orientation.
    """

    ADDRESSES: ClassVar[frozenset[str]] = frozenset(
        ("mj_model", "mj_data", "qpos", "site_xpos", "site_xmat", "end_xpos", "end_xmat")
    )
    head: Head
    k_tip: float
    k_rcm: float
    mj_model: int
    mj_data: int
    qpos: int
    site_xpos: int
    site_xmat: int
    end_xpos: int
    end_xmat: int


LAW, LAW_SIZE = overlay(Law)
_TARGET, _SHIFT, _QDOT = 0, 3, 5


class MinkSolver:
    """mink 1.x: min |J_T dq - T v_d|^2 + damping |dq|^2 subject to J_rcm dq = T v_rcm and limits on dq.

    The feed-forward enters as a target one period ahead, the feedback gains as in `fill_task_rows`, so that
    mink solves the same problem as the other resolvers. Source: mink's documentation of `solve_ik`.
    """

    def __init__(self, config: MinkConfig, arm: ArmModel) -> None:
        import mink  # takes 0.3 s, which scenarios without it need not wait for

        from surgsim.control.mink_tasks import RcmTask

        self._c, model = config, arm.scene.model
        self._configuration = mink.Configuration(model)
        self._tip = mink.FrameTask("tip", "site", position_cost=config.tip_cost, orientation_cost=0.0)
        self._tip.set_target(mink.SE3.identity())
        self._sites = (arm.scene.tip_site, arm.scene.shaft_end_site)
        self._rcm = RcmTask(arm.scene.shaft_end_site, model.nv)
        self._speeds = dict(zip(joint_names(model), arm.limits.velocity.tolist(), strict=True))

    @property
    def addresses(self) -> tuple[int, ...]:
        """Of the configuration's model and data; of q in them, and of the frames of tip and shaft's end."""
        data, model = self._configuration.data, self._configuration.model
        arrays = [data.qpos]
        for site in self._sites:
            arrays += [data.site_xpos[site], data.site_xmat[site]]
        return model._address, data._address, *(array.ctypes.data for array in arrays)

    def join(self, seen: Fields, memory: Array) -> Callable[[], int]:
        """What the kernel enters to have mink's answer to the target and the RCM's shift in its memory."""
        import mink

        from surgsim.control.mink_tasks import LimitRows

        dt, normals, p_WC = seen["dt_s"].item(), seen["normals"].T, seen["p_WC"]
        target, shift, answer = memory[_TARGET:_SHIFT], memory[_SHIFT:_QDOT], memory[_QDOT:]
        rows = [self._rcm] if seen["has_trocar"][0] else None
        gain = min(1.0, self._c.position_gain_per_s * dt)
        limits = [LimitRows(self._configuration.model, self._speeds, gain, dt, seen["q"])]

        def solve() -> int:
            self._tip.transform_target_to_world.wxyz_xyz[4:] = target
            if rows:
                self._rcm.target = p_WC + normals @ shift
            try:
                answer[:] = mink.solve_ik(
                    self._configuration,
                    [self._tip],
                    dt,
                    "daqp",
                    self._c.damping,
                    limits=limits,
                    constraints=rows,
                )
            except mink.NoSolutionFound:
                return INFEASIBLE
            return GOES_ON

        return solve


@compiled
def mink_velocity(gains: Array, seen: Seen, memory: Array, out: Resolved) -> int:
    """The answer of `MinkSolver`, projected on Omega; all but mink's own solve is done here.

    Memory, written anew at every tick: the tip's target one period ahead (3,) [m], e_N + T v_rcm (2,) [m],
    and mink's answer (n,) [rad/s].
    """
    law = gains[:LAW_SIZE].view(LAW)[0]
    n, m = seen.q.size, 3 + seen.rows
    J, v = scratch_matrix(m, n), scratch(m)
    fill_task_rows(seen, law.k_tip, law.k_rcm, J, v)
    for i in range(3):
        memory[_TARGET + i] = seen.p_WT[i] + seen.dt_s * v[i]
    for i in range(seen.rows):  # mink's row reads J dq = -N (p - target)
        memory[_SHIFT + i] = seen.rcm_error[i] + seen.dt_s * v[3 + i]
    _place(law, seen)
    status = enter(gains)
    if status != GOES_ON:
        return status
    answer(seen, memory[_QDOT:], J, v, out)
    return GOES_ON


@compiled
def _place(law: Law, seen: Seen) -> None:
    """What `mink.Configuration.update` does for tip and shaft, which then go where they are believed to be.

    MuJoCo takes Jacobians at the site's place, so that they follow.
    """
    qpos = vector(law.qpos, seen.q.size)
    for i in range(seen.q.size):
        qpos[i] = seen.q[i]
    mj_kinematics(law.mj_model, law.mj_data)
    mj_comPos(law.mj_model, law.mj_data)
    tip, turn = vector(law.site_xpos, 3), doubles(law.site_xmat, 3, 3)
    end, end_turn = vector(law.end_xpos, 3), doubles(law.end_xmat, 3, 3)
    for i in range(3):
        tip[i], end[i] = seen.p_WT[i], seen.p_WS[i]
        for k in range(3):
            turn[i, k] = end_turn[i, k] = seen.R_WT[i, k]


def _examine(gains: Array, seen: Seen, memory: Array) -> Mapping[str, Array]:
    """The rows that mink could not meet."""
    law, m = laid_over(Law, gains), 3 + int(seen.rows)
    J, v = np.zeros((m, seen.q.size)), np.zeros(m)
    fill_task_rows(seen, law.k_tip, law.k_rcm, J, v)
    return {"J": J, "v": v}
