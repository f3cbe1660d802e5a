"""Policy: a callable that moves tip or joints, in place of a resolver."""

import math
from typing import Annotated, Any, Literal, Union

import numpy as np
from pydantic import Field, PositiveFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig, Surroundings
from surgsim.compiled import compiled
from surgsim.control.inside import resolve_below
from surgsim.control.joining import memory_size
from surgsim.control.policies.asking import ACTION, Asker, ask, asking_gains
from surgsim.control.policies.registry import find_policy
from surgsim.control.redundancy import follows_roll, redundancy_needed, shares_null_space
from surgsim.control.resolvers import RESOLVERS
from surgsim.control.resolvers.base import KernelResolver
from surgsim.control.resolvers.pinv import PinvConfig
from surgsim.control.resolvers.rows import answer, fill_task_rows
from surgsim.models.arm import ArmModel
from surgsim.tick.algebra import times
from surgsim.tick.arrays import Resolved, Seen
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.status import GOES_ON

_OTHERS = tuple(RESOLVERS.usable(name) for name in RESOLVERS.names() if name != "policy")
AnyOtherResolver: Any = Annotated[Union[_OTHERS], Field(discriminator="type", title="resolver")]  # noqa: UP007
_TIP_REF = ACTION + 3
_BELOW = _TIP_REF + 3
_KEPT = 15


class PolicyConfig(PartConfig):
    """Asks a named policy for the velocity of the tip or of the joints.

    Attributes:
        name: The policy: shipped, registered, or an entry point of the group `surgsim.policies`.
        action: What its action is: a `tip_velocity` (3) [m/s] or a `joint_velocity` (n) [rad/s].
        resolver: Resolves a tip velocity and holds the RCM; not used for joint velocities.
        tip_speed_max_m_per_s: Bound of each component of a tip velocity.
        decimation: The policy is asked once in that many control ticks; its action holds in between.
    """

    type: Literal["policy"] = "policy"
    name: str = "proportional"
    action: Literal["tip_velocity", "joint_velocity"] = "tip_velocity"
    resolver: AnyOtherResolver = PinvConfig()
    tip_speed_max_m_per_s: PositiveFloat = 0.1
    decimation: Annotated[int, Field(ge=1, le=100_000)] = 1

    @property
    def needs_redundancy(self) -> int:
        """As much as the resolver of a tip velocity."""
        return redundancy_needed(self.resolver) if self.action == "tip_velocity" else 0

    @property
    def shares_null_space(self) -> bool:
        """Whether the resolver of a tip velocity does."""
        return self.action == "tip_velocity" and shares_null_space(self.resolver)

    @property
    def follows_roll(self) -> bool:
        """Whether the resolver of a tip velocity does; joint velocities may."""
        return self.action == "joint_velocity" or follows_roll(self.resolver)

    def check(self, scenario: Surroundings) -> None:
        """Refuse a scenario that the resolver of a tip velocity does not fit."""
        if self.action == "tip_velocity":
            self.resolver.check(scenario)

    def build(self, arm: ArmModel) -> KernelResolver:
        """The resolver.

        Raises:
            SurgsimError: If there is no policy of this name.
        """
        policy, tip = find_policy(self.name), self.action == "tip_velocity"
        limit = np.full(3, self.tip_speed_max_m_per_s) if tip else arm.limits.velocity
        below: Any = self.resolver.build(arm) if tip else None
        return KernelResolver(
            kernel=follow_tip_velocity if tip else follow_joint_velocity,
            arm=arm,
            gains=asking_gains(self.decimation, limit),
            memory_size=ACTION + limit.size + 3 + memory_size(below),
            columns=tuple(getattr(below, "columns", ())),
            inside=Asker(self.name, policy, limit.size),
            below=below,
        )


@compiled
def follow_tip_velocity(gains: Array, seen: Seen, memory: Array, out: Resolved) -> int:
    """The policy takes the task's place: the resolver below, and the torque law, follow its motion.

    With the action u, and p_ref from the tip at the start,

        command := (p_ref, u, 0),  q' from the resolver below,  p_ref(k+1) = p_ref(k) + T u(k)

    What the task asks for reaches them through the policy alone. Memory: that of `ask`, p_ref (3,) [m], and
    that of the resolver below.
    """
    status = ask(gains, memory)
    if status != GOES_ON:
        return status
    action, p_ref, below = memory[ACTION:_TIP_REF], memory[_TIP_REF:_BELOW], memory[_BELOW:]
    _begin(seen, p_ref)
    kept = scratch(_KEPT)
    _keep_command(seen, kept)
    _tell(seen, p_ref, action)
    status = resolve_below(gains, seen, below, out)
    if status != GOES_ON:  # what is seen stays as the resolver below saw it, for who looks into it
        return status
    _put_back(seen, kept)
    _move_on(seen, p_ref, action, out)
    return GOES_ON


@compiled
def follow_joint_velocity(gains: Array, seen: Seen, memory: Array, out: Resolved) -> int:
    """The policy takes the resolver's place: q' = P_Omega[u], and the torque law follows its motion.

    With the action u, and p_ref from the tip at the start,

        command := (p_ref, J_T q', 0),  p_ref(k+1) = p_ref(k) + T J_T q'(k)

    Memory: that of `ask`, then p_ref (3,) [m].
    """
    status = ask(gains, memory)
    if status != GOES_ON:
        return status
    n, m = seen.q.size, 3 + seen.rows
    J, v, moved = scratch_matrix(m, n), scratch(m), scratch(3)
    action, p_ref = memory[ACTION : ACTION + n], memory[ACTION + n : ACTION + n + 3]
    _begin(seen, p_ref)
    fill_task_rows(seen, 0.0, 0.0, J, v)
    answer(seen, action, J, v, out)
    times(seen.Jv_WT, out.qdot, moved)
    _move_on(seen, p_ref, moved, out)
    return GOES_ON


@compiled
def _begin(seen: Seen, p_ref: Array) -> None:
    """The reference is at first where the tip is."""
    if seen.first:
        for i in range(3):
            p_ref[i] = seen.p_WT[i]


@compiled
def _move_on(seen: Seen, p_ref: Array, v: Array, out: Resolved) -> None:
    """The command for the torque law, and the reference of the next tick."""
    for i in range(3):
        out.p_WTd[i], out.v_WTd[i], out.a_WTd[i] = p_ref[i], v[i], 0.0
        p_ref[i] += seen.dt_s * v[i]


@compiled
def _tell(seen: Seen, p: Array, v: Array) -> None:
    """Have a tip's motion commanded, and nothing else."""
    seen.roll_rate, seen.jaw, seen.budget_j = 0.0, 0.0, math.inf
    for i in range(3):
        seen.p_WTd[i], seen.v_WTd[i], seen.a_WTd[i], seen.budget_f_T[i] = p[i], v[i], 0.0, 0.0


@compiled
def _keep_command(seen: Seen, kept: Array) -> None:
    """Keep the task's command (15,)."""
    kept[0], kept[1], kept[2] = seen.roll_rate, seen.jaw, seen.budget_j
    for i in range(3):
        kept[3 + i], kept[6 + i], kept[9 + i] = seen.p_WTd[i], seen.v_WTd[i], seen.a_WTd[i]
        kept[12 + i] = seen.budget_f_T[i]


@compiled
def _put_back(seen: Seen, kept: Array) -> None:
    """Have the command that was kept."""
    seen.roll_rate, seen.jaw, seen.budget_j = kept[0], kept[1], kept[2]
    for i in range(3):
        seen.p_WTd[i], seen.v_WTd[i], seen.a_WTd[i] = kept[3 + i], kept[6 + i], kept[9 + i]
        seen.budget_f_T[i] = kept[12 + i]
