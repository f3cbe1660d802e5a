"""Interface of a torque-level law."""

from dataclasses import dataclass, field
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from surgsim.control.problem import Resolution
from surgsim.control.rcm import Rcm
from surgsim.models.arm import Dynamics, Kinematics
from surgsim.plant.state import NO_FORCE
from surgsim.tasks.base import TipCommand

Array = NDArray[np.float64]
Memory = TypeVar("Memory")


@dataclass(frozen=True, slots=True, kw_only=True)
class TorqueProblem:
    """All that a torque law may use at a tick.

    Attributes:
        t_s: Time since the controller started [s].
        dt_s: Control period [s].
        q: Measured joint positions (7,) [rad].
        v: Measured joint velocities (7,) [rad/s].
        tau_measured: Joint torques that acted over the last period (7,) [N m].
        kin: Nominal kinematics at `q`.
        dyn: Nominal dynamics at `q`, `v`.
        rcm: RCM error and Jacobian at `q`, or None without a trocar.
        p_WC: Trocar position (3,) [m].
        v_WC: Trocar velocity (3,) [m/s].
        a_WC: Trocar acceleration (3,) [m/s^2].
        command: Desired tip motion.
        resolution: The resolver's answer.
        q_ref: Joint reference, integrated from the resolver's velocities (7,) [rad].
        f_T: Measured force of the surroundings on the tip (3,) [N].
    """

    t_s: float
    dt_s: float
    q: Array
    v: Array
    tau_measured: Array
    kin: Kinematics
    dyn: Dynamics
    rcm: Rcm | None
    p_WC: Array
    v_WC: Array
    command: TipCommand
    resolution: Resolution
    q_ref: Array
    a_WC: Array = field(default_factory=lambda: NO_FORCE)
    f_T: Array = field(default_factory=lambda: NO_FORCE)


class TorqueLaw(Protocol[Memory]):
    """Turns the resolver's answer into joint torques; each term of the sum is kept apart."""

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of the terms, in the order of `torque`'s rows."""
        ...

    def start(self, problem: TorqueProblem) -> Memory:
        """State before the first tick."""
        ...

    def torque(self, problem: TorqueProblem, memory: Memory) -> tuple[Array, Memory]:
        """Terms of the torque as rows (len(terms), 7) [N m], to be summed, and the next state.

        Raises:
            ControlFailure: If there is no answer.
            numpy.linalg.LinAlgError: If the task Jacobian has lost rank.
        """
        ...
