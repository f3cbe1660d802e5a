"""External: a controller outside surgsim gives the joint torques, in place of a torque law."""

from typing import ClassVar, Literal

import numpy as np

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.control.external.config import ExternalPartConfig
from surgsim.control.external.exchange import POST_SIZE, exchange
from surgsim.control.external.layout import JOINT_TORQUE
from surgsim.control.torque_laws.base import KernelTorqueLaw
from surgsim.models.arm import ArmModel
from surgsim.tick.arrays import Seen
from surgsim.tick.scratch import scratch
from surgsim.tick.status import EXTERNAL, GOES_ON

_ADDS_BIAS = POST_SIZE


class ExternalLawConfig(ExternalPartConfig):
    """Asks a controller outside surgsim, a process or a C function, for the joint torques.

    Attributes:
        gives: What it answers.
        add_bias: Whether gravity, Coriolis and centrifugal torque of the nominal model are added.
    """

    follows_roll: ClassVar[bool] = True  # it is told of it
    type: Literal["external"] = "external"
    gives: Literal["joint_torque"] = "joint_torque"
    add_bias: bool = True

    def build(self, arm: ArmModel) -> KernelTorqueLaw:
        """The law, its controller started.

        Raises:
            SurgsimError: If no command is given for it, or it does not start.
        """
        outside = self.outside(arm, JOINT_TORQUE)
        return KernelTorqueLaw(
            kernel=external_torque,
            arm=arm,
            terms=("external", "bias"),
            gains=np.append(outside.gains, float(self.add_bias)),
            memory_size=outside.memory_size,
            failures={EXTERNAL: outside.reason},
            outside=outside,
        )


@compiled
def external_torque(gains: Array, seen: Seen, memory: Array, out: Array) -> int:
    """Rows u and bias: tau = u, or u + bias, with u the controller's torques.

    The resolver above it is not used; the controller sees its answer as `qdot_ref`. Memory: the number of the
    last request, then that of a function.
    """
    torque = scratch(seen.q.size)
    status: int = exchange(gains, seen, memory, torque)
    if status != GOES_ON:
        return status
    for j in range(seen.q.size):
        out[0, j] = torque[j]
        out[1, j] = seen.bias[j] if gains[_ADDS_BIAS] != 0.0 else 0.0
    return GOES_ON
