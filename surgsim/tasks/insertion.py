"""Insertion: from outside the patient through the port, along its axis, to where the work begins."""

from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from surgsim.catalog import PartConfig
from surgsim.columns import scalar
from surgsim.models.config import TrocarConfig, Vec3
from surgsim.spatial import unit
from surgsim.tasks.base import Array, Feedback, TipCommand
from surgsim.tasks.profile import Profile
from surgsim.tasks.success import PATH_NEEDS, RunColumns, Success

_REACH_SAMPLES = 60
_ALIGNED_M = 0.02  # nearer to the port, tip and trocar alone do not say how the shaft is turned
_ARRIVED_M = 1e-3
_BESIDE_M = 1e-3
_AT_REST = np.zeros(3)
TO_TARGET = 2.0
"""Value of the column `insertion_phase` once the tip is at depth and on the way to the target."""


class InsertionConfig(PartConfig):
    """Insertion through the port: along its axis from outside, then straight to a target inside.

    Attributes:
        start_m: Where the tip is at first, world frame [m]: on the port's axis, outside.
        depth_m: How deep the tip goes along the axis before it turns to the target [m].
        target_from_port_m: Where it then goes, from the port, world axes [m]; null: it stays there.
        guidance: Who leads the tip along the axis: `planned`, the task with a smooth profile; `hands_on`,
            whoever pulls at the instrument, while the task holds the axis and gives way along it.
        give_way: With `hands_on`, the share of the measured speed along the axis that is followed; the law's
            damping acts on the rest.
        let_go_s: With `hands_on`, the time at depth before it goes on to the target [s].
        held_m: The shaft is held through a point on the port's axis at least this far behind the tip, the
            trocar itself once the tip is that deep [m].
        duration_s: Time of both motions [s]; with `hands_on` the longest that the whole may take.
        ramp_s: Time of each of the smooth ramps [s], at most half of a motion.
        hold_start_s: Time at rest before [s].
        hold_end_s: Time at rest after [s].
    """

    enters_port: ClassVar[bool] = True

    type: Literal["insertion"] = "insertion"
    start_m: Vec3 | None = None
    depth_m: Annotated[float, Field(ge=0.02, le=0.5)] = 0.1
    target_from_port_m: Vec3 | None = None
    guidance: Literal["planned", "hands_on"] = "planned"
    give_way: Annotated[float, Field(ge=0.0, le=1.0)] = 0.9
    let_go_s: NonNegativeFloat = 1.5
    held_m: Annotated[float, Field(gt=0.0, le=0.3)] = 0.08
    duration_s: PositiveFloat = 10.0
    ramp_s: PositiveFloat = 1.0
    hold_start_s: NonNegativeFloat = 0.5
    hold_end_s: NonNegativeFloat = 0.5

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.held_m > self.depth_m:
            raise ValueError(f"held_m {self.held_m:g} must be at most depth_m {self.depth_m:g}")
        return self

    def build(
        self,
        start: Array,
        period_s: float = 0.001,
        seed: np.random.SeedSequence | None = None,
        trocar: TrocarConfig | None = None,
    ) -> "Insertion":
        """The task through `trocar`, by default one 5 cm below `start` (3,) [m].

        Raises:
            ValueError: If the start is not on the port's axis outside the patient.
        """
        if trocar is None:
            trocar = TrocarConfig(position_m=(float(start[0]), float(start[1]), float(start[2]) - 0.05))
        return Insertion(self, np.array(start), trocar)

    def success(self, run: RunColumns) -> Success:
        """Whether the tip came to its depth, and from there to the target."""
        if run["insertion_phase"][-1] < TO_TARGET:
            depth = 1e3 * float(run["insertion_depth_m"][-1])
            reason = f"the tip came to {depth:.1f} mm of {1e3 * self.depth_m:.1f} mm depth"
            return Success(done=False, reason=reason)
        return Success(done=True, reason="the instrument is inserted", needs=PATH_NEEDS)


class Insertion:
    """Two straight motions with smooth profiles; the first is planned or led by hand.

    Near the port the point through which the shaft passes says little about how it is turned, and nothing
    when the tip is in it: with tip and trocar one, the RCM rows are rows of the tip's own. Every point of
    the port's axis serves as well while the tip moves along it, so the command shifts the remote centre back
    along the axis, to `held_m` behind the tip.
    """

    columns = (scalar("insertion_depth", "m"), scalar("insertion_phase"))

    def __init__(self, config: InsertionConfig, start: Array, trocar: TrocarConfig) -> None:
        self._c = config
        self._port, self._axis = np.array(trocar.position_m), unit(np.array(trocar.axis))
        above = start - self._port
        height = float(above @ self._axis)
        if height <= 0.0 or np.linalg.norm(above - height * self._axis) > _BESIDE_M:
            raise ValueError("start_m must be on the port's axis, outside the patient")
        self._start = self._port + height * self._axis
        self._inside = self._port - config.depth_m * self._axis
        offset = config.target_from_port_m
        self._target = self._inside if offset is None else self._port + np.array(offset)
        first = config.depth_m + height
        second = float(np.linalg.norm(self._target - self._inside))
        self._first = _profile(config, first / (first + second), config.hold_start_s)
        self._second = _profile(config, second / (first + second), 0.0) if second > 0.0 else None
        self.reset()

    @property
    def duration_s(self) -> float:
        """Length of the whole task, or the longest that it may take [s]."""
        return self._c.hold_start_s + self._c.duration_s + self._c.hold_end_s

    @property
    def reacts(self) -> bool:
        """Whether a hand leads it."""
        return self._c.guidance == "hands_on"

    def reach(self) -> list[tuple[str, Array]]:
        """Points of both motions but those nearest to the port."""
        ends = [(self._start, self._inside), (self._inside, self._target)]
        shares = np.linspace(0.0, 1.0, _REACH_SAMPLES)
        points = [a + s * (b - a) for a, b in ends for s in shares]
        return [("the path point", p) for p in points if abs(self._depth(p)) >= _ALIGNED_M]

    def reset(self) -> None:
        """Forget the last run."""
        self._arrived_s: float | None = None
        self._values = np.zeros(2)

    def command(self, t_s: float, feedback: Feedback | None = None) -> TipCommand:
        """Desired tip motion at `t_s` [s]."""
        if feedback is None:
            after = t_s - self._first.hold_start_s - self._first.duration_s
        else:
            if self._arrived_s is None and self._depth(feedback.p_WT) >= self._c.depth_m - _ARRIVED_M:
                self._arrived_s = t_s
            after = -1.0 if self._arrived_s is None else t_s - self._arrived_s - self._c.let_go_s
        if after >= 0.0:
            command = self._to_target(after)
        elif feedback is None:
            command = self._along(self._first, t_s, self._start, self._inside)
        else:
            command = self._led(feedback)
        depth = self._depth(command.p_WTd)
        self._values = np.array([depth, TO_TARGET if after >= 0.0 else float(depth >= 0.0)])
        return command

    def values(self) -> Array:
        """Depth [m] of the commanded tip; 0 outside, 1 on the axis inside, 2 on the way to the target."""
        return self._values

    def finished(self, t_s: float) -> bool:
        """Whether a hand-led insertion is over."""
        if self._arrived_s is None:
            return False
        moving = 0.0 if self._second is None else self._second.duration_s
        return t_s - self._arrived_s >= self._c.let_go_s + moving + self._c.hold_end_s

    def _depth(self, p: Array) -> float:
        return float((self._port - p) @ self._axis)

    def _to_target(self, after_s: float) -> TipCommand:
        if self._second is None:
            return TipCommand(p_WTd=self._inside, v_WTd=_AT_REST, a_WTd=_AT_REST)
        return self._along(self._second, after_s, self._inside, self._target)

    def _along(self, profile: Profile, t_s: float, a: Array, b: Array) -> TipCommand:
        s, s_dot, s_ddot = profile.progress(t_s)
        way = b - a
        return self._held(a + s * way, s_dot * way, s_ddot * way)

    def _led(self, feedback: Feedback) -> TipCommand:
        """The tip's own place and speed along the axis, its place on the axis across it."""
        height = -min(self._depth(feedback.p_WT), self._c.depth_m)
        speed = self._c.give_way * float(feedback.v_WT @ self._axis)
        return self._held(self._port + height * self._axis, speed * self._axis, _AT_REST)

    def _held(self, p: Array, v: Array, a: Array) -> TipCommand:
        back = self._c.held_m - self._depth(p)
        if back <= 0.0 or abs(np.linalg.norm(self._port - p) - abs(self._depth(p))) > 1e-9:
            return TipCommand(p_WTd=p, v_WTd=v, a_WTd=a)
        along = float(v @ self._axis) * self._axis
        return TipCommand(p_WTd=p, v_WTd=v, a_WTd=a, rcm_shift=back * self._axis, rcm_shift_rate=along)


def _profile(config: InsertionConfig, share: float, hold_s: float) -> Profile:
    """Profile of one motion that takes `share` of the time."""
    duration = share * config.duration_s
    ramp = min(config.ramp_s, 0.5 * duration)
    return Profile(hold_start_s=hold_s, duration_s=duration, ramp_s=ramp, hold_end_s=0.0)
