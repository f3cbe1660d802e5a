"""Policy: a callable that moves tip or joints, in place of a resolver."""

from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal, Union

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat

from surgsim.catalog import PartConfig
from surgsim.columns import Block
from surgsim.control.policies.asking import Asker, Held
from surgsim.control.policies.registry import find_policy
from surgsim.control.problem import Resolution, VelocityProblem, bounded_resolution, stacked_rows
from surgsim.control.redundancy import redundancy_needed
from surgsim.control.resolvers import RESOLVERS
from surgsim.control.resolvers.pinv import PinvConfig
from surgsim.models.arm import ArmModel
from surgsim.tasks.base import TipCommand

Array = NDArray[np.float64]
_OTHERS = tuple(RESOLVERS.usable(name) for name in RESOLVERS.names() if name != "policy")
AnyOtherResolver: Any = Annotated[Union[_OTHERS], Field(discriminator="type", title="resolver")]  # noqa: UP007


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

    def build(self, arm: ArmModel) -> "PolicyResolver":
        """The resolver.

        Raises:
            SurgsimError: If there is no policy of this name.
        """
        limit = np.full(3, self.tip_speed_max_m_per_s)
        if self.action == "joint_velocity":
            limit = arm.limits.velocity
        asker = Asker(self.name, find_policy(self.name), limit, self.decimation)
        return PolicyResolver(asker, self.resolver.build(arm) if self.action == "tip_velocity" else None)


@dataclass(frozen=True, slots=True, kw_only=True)
class PolicyMemory:
    """The tip reference p_WTd (3,) [m], the action that holds, and the inner resolver's memory."""

    p_WTd: Array
    held: Held | None
    inner: Any


class PolicyResolver:
    """The policy takes the task's place: resolver and torque law below follow its motion.

    With the action u, and p_ref from the measured tip at the start,

        tip_velocity     command := (p_ref, u, 0),      q' from the inner resolver
        joint_velocity   command := (p_ref, J_T q', 0), q' = P_Omega[u]
        p_ref(k+1) = p_ref(k) + T v_ref(k)

    `Resolution.command` hands the command on to the torque law. What the task asks for reaches them through
    the policy alone.

    Args:
        asker: Asks the policy.
        inner: Resolves a tip velocity; None for joint velocities.
    """

    def __init__(self, asker: Asker, inner: Any) -> None:
        self._asker = asker
        self._inner = inner
        self.columns: tuple[Block, ...] = tuple(getattr(inner, "columns", ()))

    def start(self, problem: VelocityProblem) -> PolicyMemory:
        """The reference is where the tip is; the policy has not been asked."""
        self._asker.start()
        return PolicyMemory(p_WTd=problem.kin.p_WT, held=None, inner=None)

    def step(self, problem: VelocityProblem, memory: PolicyMemory) -> tuple[Resolution, PolicyMemory]:
        """Joint velocities for one period, with the command that they follow."""
        held = self._asker.ask(problem, memory.held)
        inner = memory.inner
        if self._inner is None:
            J, v = stacked_rows(problem, 0.0, 0.0)
            resolution = bounded_resolution(problem, held.action, J, v)
            command = _moving(memory.p_WTd, problem.kin.Jv_WT @ resolution.qdot)
        else:
            command = _moving(memory.p_WTd, held.action)
            asked = replace(problem, command=command)
            if memory.held is None:
                inner = self._inner.start(asked)
            resolution, inner = self._inner.step(asked, inner)
        after = command.p_WTd + problem.dt_s * command.v_WTd
        return replace(resolution, command=command), PolicyMemory(p_WTd=after, held=held, inner=inner)


def _moving(p: Array, v: Array) -> TipCommand:
    return TipCommand(p_WTd=p, v_WTd=v, a_WTd=np.zeros(3))
