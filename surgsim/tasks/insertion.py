"""Insertion: from outside the patient through the port, along its axis, to where the work begins.

What is led is the shaft's end S, which is the tip T of a straight instrument. An angled tip goes ahead of it,
and where it points across the shaft is left to the arm's last joints, as the roll of a straight shaft is. So
the tip is asked to be where it is once the shaft's end is where it should be, the instrument turned as it is:

    p_WTd = p_WSd + r,   v_WTd = v_WSd + w x r,   a_WTd = a_WSd + w x (w x r),   r = R_WT p_ST

with measured R_WT and angular velocity w. The tip's error is then that of the shaft's end.
"""

from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.columns import scalar
from surgsim.compiled import compiled
from surgsim.models.config import TrocarConfig, Vec3
from surgsim.spatial import unit
from surgsim.tasks.base import Feedback, TipCommand
from surgsim.tasks.profile import progress
from surgsim.tasks.success import PATH_NEEDS, RunColumns, Success
from surgsim.tick import arrays
from surgsim.tick.algebra import cross, dot, norm, times
from surgsim.tick.blank import new_command, new_feedback
from surgsim.tick.scratch import scratch
from surgsim.tick.status import GOES_ON

_REACH_SAMPLES = 60
_ALIGNED_M = 0.02  # nearer to the port, tip and trocar alone do not say how the shaft is turned
_ARRIVED_M = 1e-3
_BESIDE_M = 1e-3
TO_TARGET = 2.0
"""Value of the column `insertion_phase` once the tip is at depth and on the way to the target."""
PORT, AXIS, FROM, INSIDE, TARGET = (slice(3 * k, 3 * k + 3) for k in range(5))
LED, DEPTH, HELD, GIVE_WAY, LET_GO, END = range(15, 21)
FIRST, SECOND, BENT = slice(21, 24), slice(24, 27), slice(27, 30)
"""Gains: places and axis (3,) [m]; whether a hand leads; config's depth_m, held_m, give_way, let_go_s and
hold_end_s; hold, duration and ramp of both motions [s], a duration of 0 if there is no second; p_ST [m]."""
ARRIVED, SINCE = 0, 1
"""Memory: whether the shaft's end came to its depth, and when [s]."""


@compiled
def _depth(gains: Array, p: Array) -> float:
    """How deep a point is in the patient, along the axis [m]."""
    return dot(gains[PORT] - p, gains[AXIS])


@compiled
def _rest(out: arrays.Command, p: Array) -> None:
    """At rest at `p`, the shaft through the trocar."""
    for i in range(3):
        out.p_WTd[i] = p[i]
        out.v_WTd[i] = out.a_WTd[i] = out.rcm_shift[i] = out.rcm_shift_rate[i] = 0.0


@compiled
def _hold(gains: Array, out: arrays.Command) -> None:
    """Shift the remote centre to `held_m` behind a shaft's end that is on the axis and not yet so deep."""
    deep = _depth(gains, out.p_WTd)
    back = gains[HELD] - deep
    if back <= 0.0 or abs(norm(gains[PORT] - out.p_WTd) - abs(deep)) > 1e-9:
        return
    along = dot(out.v_WTd, gains[AXIS])
    for i in range(3):
        out.rcm_shift[i], out.rcm_shift_rate[i] = back * gains[AXIS][i], along * gains[AXIS][i]


@compiled
def _along(gains: Array, timing: Array, t_s: float, a: Array, b: Array, out: arrays.Command) -> None:
    """On the straight way from `a` to `b`."""
    s, s_dot, s_ddot = progress(timing[0], timing[1], timing[2], t_s)
    for i in range(3):
        way = b[i] - a[i]
        out.p_WTd[i], out.v_WTd[i], out.a_WTd[i] = a[i] + s * way, s_dot * way, s_ddot * way
    _hold(gains, out)


@compiled
def _is_bent(gains: Array) -> bool:
    return norm(gains[BENT]) > 0.0


@compiled
def _bent(gains: Array, feedback: arrays.Feedback, r: Array, v: Array) -> None:
    """Fill r = R_WT p_ST [m] and v = w x r [m/s] (3,)."""
    times(feedback.R_WT, gains[BENT], r)
    cross(feedback.w_WT, r, v)


@compiled
def _shaft_end(gains: Array, feedback: arrays.Feedback, p: Array, v: Array) -> None:
    """Fill place [m] and velocity [m/s] of the shaft's end (3,), as measured."""
    p[:] = feedback.p_WT
    v[:] = feedback.v_WT
    if not _is_bent(gains):
        return
    r, moved = scratch(3), scratch(3)
    _bent(gains, feedback, r, moved)
    for i in range(3):
        p[i] -= r[i]
        v[i] -= moved[i]


@compiled
def _carry_tip(gains: Array, feedback: arrays.Feedback, out: arrays.Command) -> None:
    """From what the shaft's end is asked to do to what the tip is."""
    if not _is_bent(gains):
        return
    r, moved, turned = scratch(3), scratch(3), scratch(3)
    _bent(gains, feedback, r, moved)
    cross(feedback.w_WT, moved, turned)
    for i in range(3):
        out.p_WTd[i] += r[i]
        out.v_WTd[i] += moved[i]
        out.a_WTd[i] += turned[i]


@compiled
def _led(gains: Array, feedback: arrays.Feedback, out: arrays.Command) -> None:
    """The shaft's end's own place and speed along the axis, its place on the axis across it."""
    p, v = scratch(3), scratch(3)
    _shaft_end(gains, feedback, p, v)
    height = -min(_depth(gains, p), gains[DEPTH])
    speed = gains[GIVE_WAY] * dot(v, gains[AXIS])
    for i in range(3):
        out.p_WTd[i], out.v_WTd[i] = gains[PORT][i] + height * gains[AXIS][i], speed * gains[AXIS][i]
    _hold(gains, out)


@compiled
def _since_arrival(gains: Array, feedback: arrays.Feedback, memory: Array) -> float:
    """Time since the hand brought the shaft's end to its depth [s]; -1 before."""
    p, v = scratch(3), scratch(3)
    _shaft_end(gains, feedback, p, v)
    if memory[ARRIVED] == 0.0 and _depth(gains, p) >= gains[DEPTH] - _ARRIVED_M:
        memory[ARRIVED], memory[SINCE] = 1.0, feedback.t_s
    return feedback.t_s - memory[SINCE] if memory[ARRIVED] == 1.0 else -1.0


@compiled
def insert(gains: Array, feedback: arrays.Feedback, memory: Array, out: arrays.Command) -> int:
    """Two straight motions with smooth profiles; the first is planned or led by hand."""
    out.finished = 0
    if gains[LED] == 1.0:
        since = _since_arrival(gains, feedback, memory)
        after = since - gains[LET_GO] if since >= 0.0 else -1.0
        if since >= gains[LET_GO] + gains[SECOND][1] + gains[END]:
            out.finished = 1
    else:
        after = feedback.t_s - gains[FIRST][0] - gains[FIRST][1]
    _rest(out, gains[INSIDE])
    if after >= 0.0 and gains[SECOND][1] > 0.0:
        _along(gains, gains[SECOND], after, gains[INSIDE], gains[TARGET], out)
    elif after < 0.0 and gains[LED] == 1.0:
        _led(gains, feedback, out)
    elif after < 0.0:
        _along(gains, gains[FIRST], feedback.t_s, gains[FROM], gains[INSIDE], out)
    out.values[0] = _depth(gains, out.p_WTd)
    out.values[1] = TO_TARGET if after >= 0.0 else 1.0 if out.values[0] >= 0.0 else 0.0
    _carry_tip(gains, feedback, out)
    return GOES_ON


class InsertionConfig(PartConfig):
    """Insertion through the port: along its axis from outside, then straight to a target inside.

    Attributes:
        start_m: Where the shaft's end, a straight instrument's tip, is at first, world frame [m]: on the
            port's axis, outside.
        depth_m: How deep the shaft's end goes along the axis before it turns to the target [m].
        target_from_port_m: Where it then goes, from the port, world axes [m]; null: it stays there.
        guidance: Who leads it along the axis: `planned`, the task with a smooth profile; `hands_on`,
            whoever pulls at the instrument, while the task holds the axis and gives way along it.
        give_way: With `hands_on`, the share of the measured speed along the axis that is followed; the law's
            damping acts on the rest.
        let_go_s: With `hands_on`, the time at depth before it goes on to the target [s].
        held_m: The shaft is held through a point on the port's axis at least this far behind its end, the
            trocar itself once the end is that deep [m].
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
        p_ST: Array | None = None,
    ) -> "Insertion":
        """The task through `trocar`, by default one 5 cm below `start` (3,) [m].

        Raises:
            ValueError: If the start is not on the port's axis outside the patient.
        """
        if trocar is None:
            trocar = TrocarConfig(position_m=(float(start[0]), float(start[1]), float(start[2]) - 0.05))
        return Insertion(self, np.array(start), trocar, np.zeros(3) if p_ST is None else p_ST)

    def success(self, run: RunColumns) -> Success:
        """Whether the shaft's end came to its depth, and from there to the target."""
        if run["insertion_phase"][-1] < TO_TARGET:
            depth = 1e3 * float(run["insertion_depth_m"][-1])
            reason = f"the shaft came to {depth:.1f} mm of {1e3 * self.depth_m:.1f} mm depth"
            return Success(done=False, reason=reason)
        return Success(done=True, reason="the instrument is inserted", needs=PATH_NEEDS)


class Insertion:
    """Goes in along the axis, then to the target: `insert`.

    Near the port the point through which the shaft passes says little about how it is turned, and nothing
    when the tip is in it: with tip and trocar one, the RCM rows are rows of the tip's own. Every point of
    the port's axis serves as well while the tip moves along it, so the command shifts the remote centre back
    along the axis, to `held_m` behind the tip.

    Attributes:
        kernel: status = kernel(gains, feedback, memory, out).
        gains: Its numbers, see `PORT` and the following.
        memory: Its memory, see `ARRIVED` and the following.
    """

    columns = (scalar("insertion_depth", "m"), scalar("insertion_phase"))
    kernel = staticmethod(insert)

    def __init__(self, config: InsertionConfig, start: Array, trocar: TrocarConfig, p_ST: Array) -> None:
        self._c, self._by_hand, self._bent = config, config.guidance == "hands_on", bool(p_ST.any())
        port, axis = np.array(trocar.position_m), unit(np.array(trocar.axis))
        above = start - port
        height = float(above @ axis)
        if height <= 0.0 or np.linalg.norm(above - height * axis) > _BESIDE_M:
            raise ValueError("start_m must be on the port's axis, outside the patient")
        self._start, self._inside = port + height * axis, port - config.depth_m * axis
        offset = config.target_from_port_m
        self._target = self._inside if offset is None else port + np.array(offset)
        first, second = config.depth_m + height, float(np.linalg.norm(self._target - self._inside))
        share = first / (first + second)
        numbers = (float(self._by_hand), config.depth_m, config.held_m, config.give_way, config.let_go_s)
        self.gains = np.concatenate(
            [
                *(port, axis, self._start, self._inside, self._target),
                *(numbers, (config.hold_end_s,)),
                *(_times(config, share, config.hold_start_s), _times(config, second / (first + second), 0.0)),
                p_ST,
            ]
        )
        self.memory = np.zeros(2)
        self._out, self._told = new_command(), new_feedback()

    @property
    def duration_s(self) -> float:
        """Length of the whole task, or the longest that it may take [s]."""
        return self._c.hold_start_s + self._c.duration_s + self._c.hold_end_s

    @property
    def reacts(self) -> bool:
        """Whether a hand leads it, or the tip has to follow the shaft's end."""
        return self._by_hand or self._bent

    def reach(self) -> list[tuple[str, Array]]:
        """Points of both motions but those nearest to the port."""
        ends = [(self._start, self._inside), (self._inside, self._target)]
        shares = np.linspace(0.0, 1.0, _REACH_SAMPLES)
        points = [a + s * (b - a) for a, b in ends for s in shares]
        return [("the path point", p) for p in points if abs(_depth(self.gains, p)) >= _ALIGNED_M]

    def reset(self) -> None:
        """Forget the last run."""
        self.memory[:] = 0.0

    def command(self, t_s: float, feedback: Feedback | None = None) -> TipCommand:
        """Desired tip motion at `t_s` [s]; without feedback the shaft's end is taken to rest at the start."""
        told, out = self._told, self._out
        told.t_s = t_s
        told.p_WT[:] = self._start + self.gains[BENT] if feedback is None else feedback.p_WT
        told.v_WT[:] = 0.0 if feedback is None else feedback.v_WT
        told.R_WT[:] = np.eye(3) if feedback is None else feedback.R_WT
        told.w_WT[:] = 0.0 if feedback is None else feedback.w_WT
        self.kernel(self.gains, told, self.memory, out)
        return TipCommand(
            p_WTd=out.p_WTd.copy(),
            v_WTd=out.v_WTd.copy(),
            a_WTd=out.a_WTd.copy(),
            rcm_shift=out.rcm_shift.copy(),
            rcm_shift_rate=out.rcm_shift_rate.copy(),
        )

    def values(self) -> Array:
        """Depth [m] of the commanded shaft's end; 0 outside, 1 on the axis inside, 2 to the target."""
        values: Array = self._out.values[:2].copy()
        return values

    def finished(self, t_s: float) -> bool:
        """Whether a hand-led insertion is over."""
        wait = self._c.let_go_s + self.gains[SECOND][1] + self._c.hold_end_s
        return bool(self.memory[ARRIVED] == 1.0 and t_s - self.memory[SINCE] >= wait)


def _times(config: InsertionConfig, share: float, hold_s: float) -> tuple[float, float, float]:
    """Hold, duration and ramp of one motion that takes `share` of the time [s]."""
    duration = share * config.duration_s
    return hold_s, duration, min(config.ramp_s, 0.5 * duration)
