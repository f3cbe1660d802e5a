"""External: a controller outside surgsim gives the joint velocities, in place of a resolver."""

from typing import ClassVar, Literal

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.control.external.config import ExternalPartConfig
from surgsim.control.external.exchange import exchange
from surgsim.control.external.layout import JOINT_VELOCITY
from surgsim.control.resolvers.base import KernelResolver
from surgsim.control.resolvers.rows import answer, fill_task_rows
from surgsim.models.arm import ArmModel
from surgsim.tick.algebra import times
from surgsim.tick.arrays import Resolved, Seen
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.status import EXTERNAL, GOES_ON


class ExternalConfig(ExternalPartConfig):
    """Asks a controller outside surgsim, a process or a C function, for the joint velocities.

    Attributes:
        gives: What it answers.
    """

    follows_roll: ClassVar[bool] = True  # it is told of it
    type: Literal["external"] = "external"
    gives: Literal["joint_velocity"] = "joint_velocity"

    def build(self, arm: ArmModel) -> KernelResolver:
        """The resolver, its controller started.

        Raises:
            SurgsimError: If no command is given for it, or it does not start.
        """
        outside = self.outside(arm, JOINT_VELOCITY)
        return KernelResolver(
            kernel=external_velocity,
            arm=arm,
            gains=outside.gains,
            memory_size=outside.memory_size,
            failures={EXTERNAL: outside.reason},
            outside=outside,
        )


@compiled
def external_velocity(gains: Array, seen: Seen, memory: Array, out: Resolved) -> int:
    """The controller's joint velocities u, projected on Omega: q' = P_Omega[u].

    The residual is what the projection leaves unmet of the rows that u would meet, |J (q' - u)| with
    J = [J_T; J_rcm]. Memory: the number of the last request, then that of a function.
    """
    n, m = seen.q.size, 3 + seen.rows
    J, v, qdot = scratch_matrix(m, n), scratch(m), scratch(n)
    status: int = exchange(gains, seen, memory, qdot)
    if status != GOES_ON:
        return status
    fill_task_rows(seen, 0.0, 0.0, J, v)
    times(J, qdot, v)
    answer(seen, qdot, J, v, out)
    return GOES_ON
