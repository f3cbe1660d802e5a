"""Interface of a port estimator: a Python object, or a kernel of the compiled loop."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import numpy as np

from surgsim.array import Array
from surgsim.catalog import Surroundings
from surgsim.control.failure import ControlFailure, failure_of
from surgsim.control.seen import dynamics_of, fill_kinematics, fill_wrench, kinematics_of, new_seen, wrench_of
from surgsim.models.arm import ArmModel, Dynamics, Kinematics
from surgsim.plant.state import Wrench
from surgsim.tick.arrays import Seen
from surgsim.tick.fields import Fields
from surgsim.tick.status import GOES_ON

Memory = TypeVar("Memory")
PortKernel = Callable[[Array, Seen, Array, Array], int]


@dataclass(frozen=True, slots=True, kw_only=True)
class PortProblem:
    """All that an estimator may use at a tick.

    Attributes:
        t_s: Time since the start [s].
        dt_s: Control period [s].
        q: Measured joint positions (n,) [rad].
        v: Measured joint velocities (n,) [rad/s].
        tau_measured: Joint torques that acted over the last period (n,) [N m].
        kin: Nominal kinematics at the measured positions.
        dyn: Nominal dynamics there; None on the kinematic plant.
        p_WC: Trocar position as seen (3,) [m].
        v_WC: Trocar velocity as announced (3,) [m/s].
        wrench: What a force-torque sensor at the flange measures; None without one.
    """

    t_s: float
    dt_s: float
    q: Array
    v: Array
    tau_measured: Array
    kin: Kinematics
    dyn: Dynamics | None
    p_WC: Array
    v_WC: Array
    wrench: Wrench | None = None


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


class PortEstimatorConfig(Protocol):
    """What a controller needs of a port estimator's config."""

    @property
    def type(self) -> str:
        """Its name."""
        ...

    def check(self, scenario: Surroundings) -> None:
        """Refuse a scenario that the part does not fit.

        Raises:
            ValueError: With the reason.
        """
        ...

    def build(self, arm: ArmModel) -> PortEstimator[Any]:
        """The estimator for the nominal arm `arm`."""
        ...


@dataclass(frozen=True, kw_only=True)
class KernelPortEstimator:
    """A port estimator that is a kernel: the loop calls the kernel, this calls it from Python.

    Attributes:
        kernel: status = kernel(gains, seen, memory, out (3, 3)); compiled, or plain Python.
        arm: The nominal arm.
        gains: Its numbers, laid out as the kernel says.
        memory_size: Length of its memory, all zeros before the first tick.
        estimates: Whether the estimate differs from the trocar as seen, and is recorded.
    """

    kernel: PortKernel
    arm: ArmModel
    gains: Array
    memory_size: int = 0
    estimates: bool = True

    def start(self, problem: PortProblem) -> None:
        """The kernel makes its own memory at the first tick."""

    def step(self, problem: PortProblem, memory: Array | None) -> tuple[PortEstimate, Array]:
        """The estimate, and the kernel's memory; None is that before the first tick.

        Raises:
            ControlFailure: If the kernel has no answer.
        """
        seen = self._seen(problem)
        seen.first = memory is None
        after = np.zeros(self.memory_size) if memory is None else memory.copy()
        out = np.zeros((3, 3))
        status = self.kernel(self.gains, seen, after, out)
        if status != GOES_ON:
            raise self.failure(status, seen)
        return PortEstimate(p_WC=out[0], v_WC=out[1], a_WC=out[2]), after

    def failure(self, status: int, seen: Seen) -> ControlFailure:
        """Why there is no estimate."""
        return failure_of(status, {}, {"q": seen.q.copy()})

    def _seen(self, p: PortProblem) -> Seen:
        seen = new_seen(self.arm, dt_s=p.dt_s, has_trocar=False)
        seen.t_s, seen.q[:], seen.v[:], seen.tau[:] = p.t_s, p.q, p.v, p.tau_measured
        fill_kinematics(seen, p.kin)
        if p.dyn is not None:
            seen.M[:], seen.bias[:] = p.dyn.mass_matrix, p.dyn.bias
        seen.p_WC[:], seen.v_WC[:] = p.p_WC, p.v_WC
        fill_wrench(seen, p.wrench)
        return seen


def port_problem_of(seen: Fields, *, has_dynamics: bool) -> PortProblem:
    """What a port estimator in Python is given."""
    return PortProblem(
        t_s=seen["t_s"].item(),
        dt_s=seen["dt_s"].item(),
        q=seen["q"].copy(),
        v=seen["v"].copy(),
        tau_measured=seen["tau"].copy(),
        kin=kinematics_of(seen),
        dyn=dynamics_of(seen) if has_dynamics else None,
        p_WC=seen["p_WC"].copy(),
        v_WC=seen["v_WC"].copy(),
        wrench=wrench_of(seen),
    )
