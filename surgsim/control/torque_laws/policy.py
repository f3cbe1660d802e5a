"""Policy: a callable that gives joint torques, in place of a torque law."""

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.control.policies.asking import ACTION, Asker, ask, asking_gains
from surgsim.control.policies.registry import find_policy
from surgsim.control.torque_laws.base import KernelTorqueLaw
from surgsim.models.arm import ArmModel
from surgsim.tick.arrays import Seen
from surgsim.tick.status import GOES_ON


class PolicyLawConfig(PartConfig):
    """Asks a named policy for the joint torques.

    Attributes:
        name: The policy: shipped, registered, or an entry point of the group `surgsim.policies`.
        add_bias: Whether gravity, Coriolis and centrifugal torque of the nominal model are added.
        decimation: The policy is asked once in that many control ticks; its action holds in between.
    """

    follows_roll: ClassVar[bool] = True  # it is told of it
    type: Literal["policy"] = "policy"
    name: str = "damping"
    add_bias: bool = True
    decimation: Annotated[int, Field(ge=1, le=100_000)] = 1

    def build(self, arm: ArmModel) -> KernelTorqueLaw:
        """The law.

        Raises:
            SurgsimError: If there is no policy of this name.
        """
        limit = arm.limits.torque
        return KernelTorqueLaw(
            kernel=policy_torque,
            arm=arm,
            terms=("policy", "bias"),
            gains=np.append(asking_gains(self.decimation, limit), float(self.add_bias)),
            memory_size=ACTION + limit.size,
            inside=Asker(self.name, find_policy(self.name), limit.size),
        )


@compiled
def policy_torque(gains: Array, seen: Seen, memory: Array, out: Array) -> int:
    """Rows u and bias: tau = u, or u + bias, with u the policy's action, cut at the torque limits.

    The resolver above it is not used; its answer is recorded. The last gain says whether the bias is added.
    """
    status = ask(gains, memory)
    if status != GOES_ON:
        return status
    for j in range(seen.q.size):
        out[0, j] = memory[ACTION + j]
        out[1, j] = seen.bias[j] if gains[gains.size - 1] != 0.0 else 0.0
    return GOES_ON
