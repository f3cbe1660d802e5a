"""Policy: a callable that gives joint torques, in place of a torque law."""

from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from surgsim.catalog import PartConfig
from surgsim.control.policies.asking import Asker, Held
from surgsim.control.policies.registry import find_policy
from surgsim.control.torque_laws.base import TorqueProblem
from surgsim.models.arm import ArmModel

Array = NDArray[np.float64]


class PolicyLawConfig(PartConfig):
    """Asks a named policy for the joint torques.

    Attributes:
        name: The policy: shipped, registered, or an entry point of the group `surgsim.policies`.
        add_bias: Whether gravity, Coriolis and centrifugal torque of the nominal model are added.
        decimation: The policy is asked once in that many control ticks; its action holds in between.
    """

    type: Literal["policy"] = "policy"
    name: str = "damping"
    add_bias: bool = True
    decimation: Annotated[int, Field(ge=1, le=100_000)] = 1

    def build(self, arm: ArmModel) -> "PolicyLaw":
        """The law.

        Raises:
            SurgsimError: If there is no policy of this name.
        """
        asker = Asker(self.name, find_policy(self.name), arm.limits.torque, self.decimation)
        return PolicyLaw(asker, self.add_bias)


class PolicyLaw:
    """tau = u, or u + bias; u is the policy's action, cut at the torque limits.

    The resolver above it is not used; its answer is recorded.
    """

    terms = ("policy", "bias")

    def __init__(self, asker: Asker, add_bias: bool) -> None:
        self._asker = asker
        self._add_bias = add_bias

    def start(self, problem: TorqueProblem) -> Held | None:
        """The policy has not been asked."""
        self._asker.start()
        return None

    def torque(self, problem: TorqueProblem, memory: Held | None) -> tuple[Array, Held]:
        """Rows policy, bias (2, n) [N m]."""
        held = self._asker.ask(problem, memory)
        bias = problem.dyn.bias if self._add_bias else np.zeros_like(held.action)
        return np.stack((held.action, bias)), held
