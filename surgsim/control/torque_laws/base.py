"""Interface of a torque-level law: a Python object, or a kernel of the compiled loop."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar

import numpy as np

from surgsim.array import Array
from surgsim.catalog import PartConfig, Surroundings
from surgsim.control.failure import ControlFailure, Words, failure_of
from surgsim.control.inside import Elsewhere, Inside
from surgsim.control.joining import Desk, furnish
from surgsim.control.problem import Resolution
from surgsim.control.rcm import Rcm
from surgsim.control.seen import dynamics_of, fill_kinematics, fill_rcm_of, kinematics_of, new_seen, rcm_of
from surgsim.errors import SurgsimError
from surgsim.models.arm import ArmModel, Dynamics, Kinematics
from surgsim.plant.state import NO_FORCE
from surgsim.tasks.base import TipCommand
from surgsim.tasks.command import command_of, fill_command_of
from surgsim.tick.arrays import Seen
from surgsim.tick.fields import Fields
from surgsim.tick.python_part import first_raised
from surgsim.tick.status import GOES_ON

Memory = TypeVar("Memory")
Config = TypeVar("Config", bound=PartConfig)
TorqueKernel = Callable[[Array, Seen, Array, Array], int]


@dataclass(frozen=True, slots=True, kw_only=True)
class TorqueProblem:
    """All that a torque law may use at a tick.

    Attributes:
        t_s: Time since the controller started [s].
        dt_s: Control period [s].
        q: Measured joint positions (n,) [rad].
        v: Measured joint velocities (n,) [rad/s].
        tau_measured: Joint torques that acted over the last period (n,) [N m].
        kin: Nominal kinematics at `q`.
        dyn: Nominal dynamics at `q`, `v`.
        rcm: RCM error and Jacobian at `q`, or None without a trocar.
        p_WC: Trocar position (3,) [m].
        v_WC: Trocar velocity (3,) [m/s].
        a_WC: Trocar acceleration (3,) [m/s^2].
        command: Desired tip motion.
        resolution: The resolver's answer.
        q_ref: Joint reference, integrated from the resolver's velocities (n,) [rad].
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
        """Terms of the torque as rows (len(terms), n) [N m], to be summed, and the next state.

        Raises:
            ControlFailure: If there is no answer.
            numpy.linalg.LinAlgError: If the task Jacobian has lost rank.
        """
        ...


class TorqueLawConfig(Protocol):
    """What a controller needs of a torque law's config."""

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

    def build(self, arm: ArmModel) -> TorqueLaw[Any]:
        """The law for the nominal arm `arm`."""
        ...


@dataclass(frozen=True, kw_only=True)
class KernelTorqueLaw:
    """A torque law that is a kernel: the loop calls the kernel, this calls it from Python.

    Attributes:
        kernel: status = kernel(gains, seen, memory, out); compiled, or plain Python.
        arm: The nominal arm.
        terms: Names of the terms, in the order of the rows of `out`.
        gains: The law's numbers, laid out as the kernel says; with something inside they begin with a `Head`.
        memory_size: Length of its memory, all zeros before the first tick.
        failures: What each status of the kernel means, for the person who reads the outcome: words, or a
            function of what the kernel saw.
        inside: What the kernel enters in Python.
        outside: What answers the kernel from outside surgsim, to be ended with the run.
        commands_reference: Whether the arm's own impedance loop is given the joint reference, and adds the
            terms to its own torque.
    """

    kernel: TorqueKernel
    arm: ArmModel
    terms: tuple[str, ...]
    gains: Array
    memory_size: int = 0
    failures: Mapping[int, Words] = field(default_factory=dict)
    inside: Inside | None = None
    outside: Elsewhere | None = None
    commands_reference: bool = False

    def start(self, problem: TorqueProblem) -> None:
        """The kernel makes its own memory at the first tick."""

    def torque(self, problem: TorqueProblem, memory: Array | None) -> tuple[Array, Array]:
        """Terms of the torque, and the kernel's memory; None is that before the first tick.

        Raises:
            ControlFailure: If the kernel has no answer.
            BaseException: What a Python part inside it raised.
        """
        seen = seen_of_torque(problem, self.arm)
        seen.first = memory is None
        after = np.zeros(self.memory_size) if memory is None else memory.copy()
        out = np.zeros((len(self.terms), seen.q.size))
        desk = Desk(seen=seen, out=out, memory=after, limits=self.arm.limits, remembered={})
        own = furnish(self, desk, "law")
        status = self.kernel(own.gains, seen, after, out)
        if status != GOES_ON:
            raise first_raised(own.entered) or self.failure(status, seen)
        return out, after

    def failure(self, status: int, seen: Seen) -> ControlFailure:
        """Why there is no answer."""
        data = {"q": seen.q.copy(), "v": seen.v.copy(), "M": seen.M.copy()}
        return failure_of(status, self.failures, data, seen)


def for_joints(key: str, given: Sequence[float] | None, profile: Sequence[float], n: int) -> Array:
    """A gain for each of n joints (n,): as `given`, or where that is None from a profile along an arm.

    The profile runs from base to flange and is linear between its places; n joints are spread evenly over it.
    An arm of as many joints as the profile has places has the profile itself.

    Args:
        key: Of the gains, for the message.
        given: The gains (n,), or None.
        profile: Those of another number of joints.
        n: Number of joints.

    Raises:
        SurgsimError: If other than n are given.
    """
    if given is None:
        return np.interp(np.linspace(0.0, 1.0, n), np.linspace(0.0, 1.0, len(profile)), profile)
    if len(given) != n:
        raise SurgsimError(f"{key} has {len(given)} items for an arm of {n} joints: give {n}, or null")
    return np.array(given, dtype=np.float64)


def with_lists(config: Config, profiles: Mapping[str, Sequence[float]], n: int) -> Config:
    """`config` with n gains under each key of `profiles`, as `for_joints` gives them.

    Raises:
        SurgsimError: If it has a list of another length.
    """
    lists = {
        key: tuple(for_joints(key, getattr(config, key), profile, n).tolist())
        for key, profile in profiles.items()
    }
    return config.model_copy(update=lists)


def seen_of_torque(p: TorqueProblem, arm: ArmModel) -> Seen:
    """What a torque law is given, as a record."""
    seen = new_seen(arm, dt_s=p.dt_s, has_trocar=p.rcm is not None)
    seen.t_s = p.t_s
    seen.q[:], seen.v[:], seen.tau[:], seen.f_T[:] = p.q, p.v, p.tau_measured, p.f_T
    fill_kinematics(seen, p.kin)
    seen.M[:], seen.bias[:] = p.dyn.mass_matrix, p.dyn.bias
    fill_rcm_of(seen, p.rcm)
    seen.p_WC[:], seen.v_WC[:], seen.a_WC[:] = p.p_WC, p.v_WC, p.a_WC
    fill_command_of(seen, p.command)
    seen.qdot_ref[:], seen.q_ref[:] = p.resolution.qdot, p.q_ref
    return seen


def torque_problem_of(seen: Fields, resolution: Resolution) -> TorqueProblem:
    """What a torque law in Python is given."""
    return TorqueProblem(
        t_s=seen["t_s"].item(),
        dt_s=seen["dt_s"].item(),
        q=seen["q"].copy(),
        v=seen["v"].copy(),
        tau_measured=seen["tau"].copy(),
        kin=kinematics_of(seen),
        dyn=dynamics_of(seen),
        rcm=rcm_of(seen),
        p_WC=seen["p_WC"].copy(),
        v_WC=seen["v_WC"].copy(),
        a_WC=seen["a_WC"].copy(),
        command=command_of(seen),
        resolution=resolution,
        q_ref=seen["q_ref"].copy(),
        f_T=seen["f_T"].copy(),
    )
