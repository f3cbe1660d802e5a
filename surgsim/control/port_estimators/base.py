"""Interface of a port estimator."""

from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from surgsim.models.arm import Dynamics, Kinematics

Array = NDArray[np.float64]
Memory = TypeVar("Memory")


@dataclass(frozen=True, slots=True, kw_only=True)
class PortProblem:
    """All that an estimator may use at a tick.

    Attributes:
        t_s: Time since the start [s].
        dt_s: Control period [s].
        v: Measured joint velocities (7,) [rad/s].
        tau_measured: Joint torques that acted over the last period (7,) [N m].
        kin: Nominal kinematics at the measured positions.
        dyn: Nominal dynamics there; None on the kinematic plant.
        p_WC: Trocar position as seen (3,) [m].
        v_WC: Trocar velocity as announced (3,) [m/s].
    """

    t_s: float
    dt_s: float
    v: Array
    tau_measured: Array
    kin: Kinematics
    dyn: Dynamics | None
    p_WC: Array
    v_WC: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class PortEstimate:
    """Estimated motion of the trocar, world frame.

    Attributes:
        p_WC: Position (3,) [m].
        v_WC: Velocity (3,) [m/s].
        a_WC: Acceleration (3,) [m/s^2].
    """

    p_WC: Array
    v_WC: Array
    a_WC: Array


class PortEstimator(Protocol[Memory]):
    """Estimates the trocar's motion. Its state is explicit, so a step is a pure function."""

    def start(self, problem: PortProblem) -> Memory:
        """State before the first tick."""
        ...

    def step(self, problem: PortProblem, memory: Memory) -> tuple[PortEstimate, Memory]:
        """The estimate for this tick, and the state for the next."""
        ...
