"""What a task asks of the instrument, and the part that all path tasks share."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, Protocol, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from surgsim.catalog import PartConfig
from surgsim.models.config import Vec3
from surgsim.spatial import plane_axes
from surgsim.tasks.profile import Profile

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class TipCommand:
    """Desired tip motion at one instant, in the world frame.

    Attributes:
        p_WTd: Position (3,) [m].
        v_WTd: Velocity (3,) [m/s].
        a_WTd: Acceleration (3,) [m/s^2].
    """

    p_WTd: Array
    v_WTd: Array
    a_WTd: Array


class Task(Protocol):
    """Desired tip motion over time."""

    @property
    def duration_s(self) -> float:
        """Length of the whole task [s]."""
        ...

    def command(self, t_s: float) -> TipCommand:
        """Desired tip motion at `t_s` [s]."""
        ...


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

    @abstractmethod
    def shape(self, s: float) -> Array:
        """Rows point [m], first and second derivative by s (3, 3), in path axes, from the origin at s = 0."""

    def build(self, start: Array) -> "PathTask":
        """The task, with its path beginning at `start` (3,) [m]."""
        profile = Profile(
            hold_start_s=self.hold_start_s,
            duration_s=self.duration_s,
            ramp_s=self.ramp_s,
            hold_end_s=self.hold_end_s,
        )
        axes = plane_axes(np.array(self.normal), np.array(self.direction))
        return PathTask(shape=self, profile=profile, start=np.array(start), R_WP=np.column_stack(axes))


class PathTask:
    """A path shape followed with a smooth profile."""

    def __init__(self, *, shape: PathTaskConfig, profile: Profile, start: Array, R_WP: Array) -> None:
        self._shape = shape
        self._profile = profile
        self._start = start
        self._R_PW = R_WP.T.copy()

    @property
    def duration_s(self) -> float:
        """Length of the whole task [s]."""
        return self._profile.total_s

    def command(self, t_s: float) -> TipCommand:
        """Desired tip motion at `t_s` [s]: p(s), p' s', p'' s'^2 + p' s''."""
        s, s_dot, s_ddot = self._profile.progress(t_s)
        p, dp, ddp = self._shape.shape(s) @ self._R_PW
        return TipCommand(
            p_WTd=self._start + p,
            v_WTd=dp * s_dot,
            a_WTd=ddp * (s_dot * s_dot) + dp * s_ddot,
        )


Turns = Annotated[float, Field(gt=0.0, le=100.0)]
