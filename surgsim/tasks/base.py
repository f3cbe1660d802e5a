"""What a task asks of the instrument, and the part that all path tasks share."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Protocol, Self, runtime_checkable

import numpy as np
from numba.extending import is_jitted
from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from surgsim.array import Array
from surgsim.catalog import PartConfig, Surroundings
from surgsim.columns import Block
from surgsim.compiled import compiled
from surgsim.models.config import TrocarConfig, Vec3
from surgsim.spatial import plane_axes
from surgsim.tasks.profile import Profile, progress
from surgsim.tasks.success import RunColumns, Success, path_success
from surgsim.tick import arrays
from surgsim.tick.arrays import Command
from surgsim.tick.blank import new_command, new_feedback
from surgsim.tick.scratch import scratch_matrix
from surgsim.tick.status import GOES_ON

_REACH_SAMPLES = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class EnergyBudget:
    """What a passive controller may give to the surroundings in one period.

    Attributes:
        most_j: T(x_t) - epsilon of the remote energy tank [J].
        f_T: Measured force of the surroundings on the tip, world frame (3,) [N].
    """

    most_j: float
    f_T: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class TipCommand:
    """Desired tip motion at one instant, in the world frame.

    Attributes:
        p_WTd: Position (3,) [m].
        v_WTd: Velocity (3,) [m/s].
        a_WTd: Acceleration (3,) [m/s^2].
        roll_rate: Turn about the shaft, positive from the adapter to the tip [rad/s].
        jaw: How far the instrument's jaws close, from 0 (open) to 1.
        budget: Energy that the controller may spend; None: it is not limited.
        rcm_shift: From the trocar to the point that the shaft is held through in its place (3,) [m]; None:
            the trocar.
        rcm_shift_rate: Its rate of change (3,) [m/s].
    """

    p_WTd: Array
    v_WTd: Array
    a_WTd: Array
    roll_rate: float = 0.0
    jaw: float = 0.0
    budget: EnergyBudget | None = None
    rcm_shift: Array | None = None
    rcm_shift_rate: Array | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Feedback:
    """What a task that reacts is told at a tick: the instrument as measured.

    Attributes:
        p_WT: Tip position (3,) [m].
        v_WT: Tip velocity (3,) [m/s].
        R_WT: Tip orientation (3, 3), third column along the shaft.
        w_WT: Angular velocity of the instrument (3,) [rad/s].
        f_T: Measured force of the surroundings on the tip (3,) [N].
    """

    p_WT: Array
    v_WT: Array
    R_WT: Array
    w_WT: Array
    f_T: Array


class Task(Protocol):
    """Desired tip motion over time.

    `command` is called once a tick, in order of time, after `reset`. A task whose `reacts` is true is given
    feedback; the others are functions of time alone.
    """

    @property
    def duration_s(self) -> float:
        """Length of the whole task, or the longest that it may take [s]."""
        ...

    @property
    def reacts(self) -> bool:
        """Whether it needs feedback."""
        ...

    @property
    def columns(self) -> tuple[Block, ...]:
        """What it adds to the trace."""
        ...

    def reach(self) -> list[tuple[str, Array]]:
        """Places (3,) [m] that the tip must be able to reach, in order, each with its name for messages."""
        ...

    def reset(self) -> None:
        """Forget the last run."""
        ...

    def command(self, t_s: float, feedback: Feedback | None = None) -> TipCommand:
        """Desired tip motion at `t_s` [s]."""
        ...

    def values(self) -> Array:
        """Values of `columns` at the last command."""
        ...

    def finished(self, t_s: float) -> bool:
        """Whether there is nothing left to do at `t_s` [s], before `duration_s`."""
        ...


class TaskConfig(Protocol):
    """What a scenario needs of a task's config."""

    @property
    def type(self) -> str:
        """Its name."""
        ...

    @property
    def start_m(self) -> Vec3 | None:
        """Where the path begins, world frame [m]; None: where the tip is in `start.q_rad`."""
        ...

    def check(self, scenario: Surroundings) -> None:
        """Refuse a scenario that the task does not fit.

        Raises:
            ValueError: With the reason.
        """
        ...

    def build(self, start: Array, period_s: float, seed: np.random.SeedSequence) -> Task:
        """The task, its path beginning at `start` (3,) [m]; everything random in it comes from `seed`."""
        ...

    def success(self, run: RunColumns) -> Success:
        """Whether the task was done in a run."""
        ...


@runtime_checkable
class EnteringTaskConfig(TaskConfig, Protocol):
    """Config of a task that may begin outside the patient: `build` is given the port.

    Attributes:
        enters_port: Whether it does.
    """

    enters_port: ClassVar[bool]

    def build(
        self,
        start: Array,
        period_s: float,
        seed: np.random.SeedSequence,
        trocar: TrocarConfig | None = None,
        p_ST: Array | None = None,
    ) -> Task:
        """The task through `trocar`; what begins at `start` and goes through it is the shaft's end.

        Args:
            start: Where it begins (3,) [m].
            period_s: Between two commands [s].
            seed: Of everything random in it.
            trocar: The port.
            p_ST: The tip from the shaft's end in the instrument's frame (3,) [m]; None: it is there.

        Raises:
            ValueError: If `start` is not in front of the port.
        """
        ...


@runtime_checkable
class WeighsForce(Protocol):
    """A task that reckons with the measured force on the tip, and has to know of when it is."""

    def force_acted_over(self, time_s: float) -> None:
        """The measured force is the mean over the last `time_s` of the control period [s]: a physics step."""
        ...


@runtime_checkable
class Looks(Protocol):
    """A task that looks at things in the patient, and has to know where the plant says where they are."""

    def look_at(self, places: Mapping[str, int]) -> None:
        """Where each block begins in the plant's columns, which `Feedback.plant` has."""
        ...


class TimedTask(ABC):
    """A task whose command is a function of time alone."""

    reacts = False
    columns: tuple[Block, ...] = ()

    @property
    @abstractmethod
    def duration_s(self) -> float:
        """Length of the whole task [s]."""

    @abstractmethod
    def command(self, t_s: float, feedback: Feedback | None = None) -> TipCommand:
        """Desired tip motion at `t_s` [s]."""

    def reach(self) -> list[tuple[str, Array]]:
        """Points along the path."""
        times = np.linspace(0.0, self.duration_s, _REACH_SAMPLES)
        return [(f"at t = {t:.2f} s the path point", self.command(float(t)).p_WTd) for t in times]

    def reset(self) -> None:  # noqa: B027 - a function of time has nothing to forget
        """Forget the last run."""

    def values(self) -> Array:
        """No columns."""
        return np.zeros(0)

    def finished(self, t_s: float) -> bool:
        """It takes its time."""
        return False


class PathTaskConfig(PartConfig, ABC):
    """Keys that every path task has.

    Attributes:
        start_m: Where the path begins, world frame [m]; null: where the tip is in `start.q_rad`.
        normal: Normal of the path's plane (its z axis).
        direction: The path's x axis, made normal to `normal`.
        duration_s: Time of the motion, ramps included [s].
        ramp_s: Time of each of the smooth ramps [s].
        hold_start_s: Time at rest before it [s].
        hold_end_s: Time at rest after it [s].
    """

    kernel: ClassVar[Any]

    start_m: Vec3 | None = None
    normal: Vec3 = (0.0, 0.0, 1.0)
    direction: Vec3 = (1.0, 0.0, 0.0)
    duration_s: PositiveFloat = 10.0
    ramp_s: PositiveFloat = 1.0
    hold_start_s: NonNegativeFloat = 0.5
    hold_end_s: NonNegativeFloat = 0.5

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.ramp_s > 0.5 * self.duration_s:
            raise ValueError(f"ramp_s {self.ramp_s:g} must be at most half of duration_s {self.duration_s:g}")
        plane_axes(np.array(self.normal), np.array(self.direction))
        return self

    @property
    @abstractmethod
    def numbers(self) -> tuple[float, ...]:
        """The numbers of the path."""

    def build(
        self, start: Array, period_s: float = 0.001, seed: np.random.SeedSequence | None = None
    ) -> "PathTask":
        """The task, with its path beginning at `start` (3,) [m]; period and seed are for tasks that react."""
        profile = Profile(
            hold_start_s=self.hold_start_s,
            duration_s=self.duration_s,
            ramp_s=self.ramp_s,
            hold_end_s=self.hold_end_s,
        )
        axes = plane_axes(np.array(self.normal), np.array(self.direction))
        return PathTask(shape=self, profile=profile, start=np.array(start), R_WP=np.column_stack(axes))

    def success(self, run: RunColumns) -> Success:
        """Whether the path was followed."""
        return path_success(run)


TaskKernel = Callable[[Array, arrays.Feedback, Array, Command], int]
PathKernel = Callable[[Array, float, Array], None]
"""path(numbers, s, rows): fills point [m] and first and second derivative by s (3, 3), from the origin."""
HOLD, DURATION, RAMP, START, ROTATION, NUMBERS = 0, 1, 2, 3, 6, 15
"""Where the gains of a path task begin: times [s], start (3,) [m], R_PW (3, 3), the path's own numbers."""


@compiled
def follow(gains: Array, rows: Array, s_dot: float, s_ddot: float, out: Command) -> None:
    """Fill the command of a path whose `rows` are point and derivatives: p(s), p' s', p'' s'^2 + p' s''."""
    for i in range(3):
        p = dp = ddp = 0.0
        for k in range(3):
            turn = gains[ROTATION + 3 * k + i]
            p += rows[0, k] * turn
            dp += rows[1, k] * turn
            ddp += rows[2, k] * turn
        out.p_WTd[i] = gains[START + i] + p
        out.v_WTd[i] = dp * s_dot
        out.a_WTd[i] = ddp * (s_dot * s_dot) + dp * s_ddot


def following(path: PathKernel) -> TaskKernel:
    """The kernel of a task that follows `path` with the profile's progress; in Python where the path is."""

    def kernel(gains: Array, feedback: arrays.Feedback, memory: Array, out: Command) -> int:
        s, s_dot, s_ddot = progress(gains[HOLD], gains[DURATION], gains[RAMP], feedback.t_s)
        rows = scratch_matrix(3, 3)
        path(gains[NUMBERS:], s, rows)
        follow(gains, rows, s_dot, s_ddot, out)
        return GOES_ON

    return compiled(kernel) if is_jitted(path) else kernel


class PathTask(TimedTask):
    """A path followed with a smooth profile; its law is a kernel of the path's own file.

    Attributes:
        kernel: status = kernel(gains, feedback, memory, out).
        gains: Its numbers, see `HOLD` and the following.
    """

    def __init__(self, *, shape: PathTaskConfig, profile: Profile, start: Array, R_WP: Array) -> None:
        self._profile = profile
        self.kernel = shape.kernel
        times = (profile.hold_start_s, profile.duration_s, profile.ramp_s)
        self.gains = np.array([*times, *start, *R_WP.T.ravel(), *shape.numbers])
        self._out = new_command()
        self._feedback = new_feedback()

    @property
    def duration_s(self) -> float:
        """Length of the whole task [s]."""
        return self._profile.total_s

    def command(self, t_s: float, feedback: Feedback | None = None) -> TipCommand:
        """Desired tip motion at `t_s` [s]: p(s), p' s', p'' s'^2 + p' s''."""
        self._feedback.t_s = t_s
        self.kernel(self.gains, self._feedback, _NO_MEMORY, self._out)
        out = self._out
        return TipCommand(p_WTd=out.p_WTd.copy(), v_WTd=out.v_WTd.copy(), a_WTd=out.a_WTd.copy())


_NO_MEMORY = np.zeros(0)
Turns = Annotated[float, Field(gt=0.0, le=100.0)]
