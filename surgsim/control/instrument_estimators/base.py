"""Interface of an instrument estimator: a Python object, or a kernel of the compiled loop."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import numpy as np

from surgsim.array import Array
from surgsim.catalog import Surroundings
from surgsim.control.failure import ControlFailure, failure_of
from surgsim.control.seen import new_seen
from surgsim.models.arm import ArmModel
from surgsim.plant.state import NOT_TRACKED, TrackedPose
from surgsim.tick.arrays import Seen
from surgsim.tick.fields import Fields
from surgsim.tick.status import GOES_ON

Memory = TypeVar("Memory")
InstrumentKernel = Callable[[Array, Seen, Array, Array], int]


@dataclass(frozen=True, slots=True, kw_only=True)
class InstrumentProblem:
    """All that an estimator may use at a tick.

    Attributes:
        t_s: Time since the start [s].
        dt_s: Control period [s].
        q: Measured joint positions (n,) [rad].
        v: Measured joint velocities (n,) [rad/s].
        tracked: The tracker's last sample.
    """

    t_s: float
    dt_s: float
    q: Array
    v: Array
    tracked: TrackedPose


@dataclass(frozen=True, slots=True, kw_only=True)
class Correction:
    """The corrected tip, seen from the nominal one: T_WT = T_WN exp(twist), with the nominal tip's frame N.

    Attributes:
        linear: (3,) [m].
        angular: (3,) [rad].
    """

    linear: Array
    angular: Array


class InstrumentEstimator(Protocol[Memory]):
    """Corrects the nominal tip and shaft. Its state is explicit, so a step is a pure function.

    It is kept through ticks in which the controller has no answer: the geometry is the same after them.
    """

    def start(self, problem: InstrumentProblem) -> Memory:
        """State before the first tick."""
        ...

    def step(self, problem: InstrumentProblem, memory: Memory) -> tuple[Correction, Memory]:
        """The correction for this tick, and the state for the next."""
        ...


class InstrumentEstimatorConfig(Protocol):
    """What a controller needs of an instrument estimator's config."""

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

    def build(self, arm: ArmModel) -> InstrumentEstimator[Any]:
        """The estimator for the nominal arm `arm`."""
        ...


@dataclass(frozen=True, kw_only=True)
class KernelInstrumentEstimator:
    """An instrument estimator that is a kernel: the loop calls the kernel, this calls it from Python.

    The kernel is called before the nominal model is evaluated: of `seen` it may use time, q, v, the tracked
    pose, and `elsewhere` to place the nominal geometry (`surgsim.tick.nominal.place`).

    Attributes:
        kernel: status = kernel(gains, seen, memory, out (2, 3)); compiled, or plain Python.
        arm: The nominal arm.
        gains: Its numbers, laid out as the kernel says.
        memory_size: Length of its memory, all zeros before the first tick of a run.
        corrects: Whether there may be a correction; otherwise the kernel is not called.
    """

    kernel: InstrumentKernel
    arm: ArmModel
    gains: Array
    memory_size: int = 0
    corrects: bool = True

    def start(self, problem: InstrumentProblem) -> None:
        """The kernel makes its own memory at the first tick."""

    def step(self, problem: InstrumentProblem, memory: Array | None) -> tuple[Correction, Array]:
        """The correction, and the kernel's memory; None is that before the first tick.

        Raises:
            ControlFailure: If the kernel has no answer.
        """
        seen = self._seen(problem)
        seen.first = memory is None
        after = np.zeros(self.memory_size) if memory is None else memory.copy()
        out = np.zeros((2, 3))
        status = self.kernel(self.gains, seen, after, out)
        if status != GOES_ON:
            raise failure_of(status, {}, {"q": seen.q.copy()})
        return Correction(linear=out[0], angular=out[1]), after

    def failure(self, status: int, seen: Seen) -> ControlFailure:
        """Why there is no correction."""
        return failure_of(status, {}, {"q": seen.q.copy()})

    def _seen(self, p: InstrumentProblem) -> Seen:
        seen = new_seen(self.arm, dt_s=p.dt_s, has_trocar=False)
        seen.t_s, seen.q[:], seen.v[:] = p.t_s, p.q, p.v
        fill_tracked(seen, p.tracked)
        return seen


def fill_tracked(seen: Seen, pose: TrackedPose) -> None:
    """Write a tracker's sample into a record."""
    seen.tracked_samples, seen.tracked_age_s = pose.samples, pose.age_s
    seen.p_WT_m[:], seen.R_WT_m[:] = pose.p_WT, pose.R_WT


def instrument_problem_of(seen: Fields) -> InstrumentProblem:
    """What an instrument estimator in Python is given."""
    samples, pose = int(seen["tracked_samples"].item()), NOT_TRACKED
    if samples > 0:
        pose = TrackedPose(
            samples=samples,
            age_s=seen["tracked_age_s"].item(),
            p_WT=seen["p_WT_m"].copy(),
            R_WT=seen["R_WT_m"].copy(),
        )
    return InstrumentProblem(
        t_s=seen["t_s"].item(),
        dt_s=seen["dt_s"].item(),
        q=seen["q"].copy(),
        v=seen["v"].copy(),
        tracked=pose,
    )
