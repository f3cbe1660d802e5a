"""A simulated operator: what the eyes see decides, the hand's impedance acts."""

import math
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.catalog import ADDED, PartConfig
from surgsim.compiled import compiled
from surgsim.teleop.clutch import ClutchConfig, ClutchLaw, leaves_no_room
from surgsim.teleop.console import ConsoleState
from surgsim.teleop.goals import CLOSED, DWELL_TIME, GOAL, PLACE, PUSH, TIMEOUT, TOLERANCE, TURNED
from surgsim.teleop.hand import HandAction
from surgsim.teleop.impedance import Grip, hand_wrench
from surgsim.teleop.mapping import Mapping, motion_to_console
from surgsim.teleop.reach import Reach, ReachConfig, ReachLaw, aim, reach_at
from surgsim.teleop.roll import turn_grip
from surgsim.teleop.sight import (
    STEPS,
    Sight,
    SightConfig,
    SightLaw,
    goal_after,
    once_more,
    see_picture,
    take_aim,
)
from surgsim.teleop.tremor import TremorConfig, resonance, shake
from surgsim.tick.algebra import dot
from surgsim.tick.arrays import Record
from surgsim.tick.overlay import take


class OperatorConfig(PartConfig):
    """Eyes, decisions and hand of the operator.

    Hand impedance 135 N/m and 6.45 N s/m: the fit shown for an arm in Sci. Rep. 5, 18004 (2015); gripping
    harder raises both. The orientation values only keep the grip upright and are assumptions.

    Against delay the operator moves and waits (Ferrell, IEEE Trans. Hum. Factors Electron. 6, 1965): after
    a movement it waits `expected_delay_s`, the round trip it is used to (`auto`: that of the channels), then
    for the tip on the screen to rest, and only then corrects. Every decision takes `reaction_s`. A goal at
    the place of the one before is for the jaws alone: the hand stays, and waits until it must have seen them
    act. With a `clutch` it re-indexes the handle where that nears its stop. With `sight` it looks at the
    rings of a peg board, misses some, and grasps again.
    """

    reaction_s: NonNegativeFloat = 0.2
    expected_delay_s: NonNegativeFloat | Literal["auto"] = "auto"
    rest_speed_m_per_s: PositiveFloat = 0.003
    gaze_time_s: PositiveFloat = 0.08
    stiffness_n_per_m: PositiveFloat = 135.0
    damping_ns_per_m: NonNegativeFloat = 6.45
    turn_stiffness_nm_per_rad: NonNegativeFloat = 0.15
    turn_damping_nms_per_rad: NonNegativeFloat = 0.003
    jaw_time_s: PositiveFloat = 0.3
    roll_speed_rad_per_s: PositiveFloat = 1.0
    reach: ReachConfig = ReachConfig()
    tremor: TremorConfig = TremorConfig()
    clutch: ClutchConfig = ClutchConfig()
    sight: Annotated[SightConfig, ADDED] = SightConfig()


MOVE, WATCH, DWELL, DONE, INDEX = range(5)
"""Phases: moving the hand, waiting for the picture to rest, staying at the goal, done, re-indexing."""
_HOME_WIDTH_M = 0.01  # so near is near enough when the hand goes back to where the handle has room


class OperatorLaw(Record):
    """Numbers of the operator: as in `OperatorConfig`, and what follows from them.

    Attributes:
        reaction_s: As in the config, like the next two.
        expected_delay_s: The round trip that it is used to [s].
        rest_speed_m_per_s: Slower counts as at rest.
        period_s: Control period [s].
        blur: How much of a new picture is taken in over a period.
        jaw_step: Most that the jaws close in a period.
        roll_step: Most that the hand turns the grip in a period [rad].
        shake_last: a_1 of the tremor.
        shake_before: a_2 of the tremor.
        grip: The hand's impedance.
        reach: How it reaches.
        clutch: When it re-indexes.
        sight: What it sees of the rings.
        goals: Where the goals' rows begin in the gains.
        goal_count: How many there are.
        tremor: Where the tremor's noise begins in the memory, a row (3,) [m] for each period.
        scatter: Where the scatter of movements begins, a row (3,) for each.
    """

    reaction_s: float
    expected_delay_s: float
    rest_speed_m_per_s: float
    period_s: float
    blur: float
    jaw_step: float
    roll_step: float
    shake_last: float
    shake_before: float
    grip: Grip
    reach: ReachLaw
    clutch: ClutchLaw
    sight: SightLaw
    goals: int
    goal_count: int
    tremor: int
    scatter: int


class Operator(Record):
    """State of the operator.

    Attributes:
        begun: Whether it has looked once.
        phase: See `MOVE` and the following.
        index: The goal.
        missed: Goals given up.
        shaken: Rows of the tremor used.
        scattered: Rows of the scatter used.
        goal_start_s: When the goal was begun [s].
        leave_s: When it may be left [s].
        jaw: How far the jaws close.
        roll: How far the hand has turned the grip about its axis [rad].
        reach: The movement.
        sight: What was seen of the rings.
        seen: The tip as it is taken in (3,) [m].
        speed: Its velocity (3,) [m/s].
        target: Where the tip shall be (3,) [m]; NaN before the first goal.
        upright: Orientation that the hand keeps (3, 3).
        home: Where the handle was at first (3,) [m].
        pedal: Whether it presses the clutch's pedal.
        picture: Number of the newest picture that has come.
        shake: Displacement by tremor (3,) [m].
        shake_before: The one before it (3,) [m].
    """

    SHAPES: ClassVar[dict[str, str]] = {
        **{name: "3" for name in ("seen", "speed", "target", "shake", "shake_before", "home")},
        "upright": "3 3",
    }
    begun: int
    phase: int
    index: int
    missed: int
    shaken: int
    scattered: int
    goal_start_s: float
    leave_s: float
    jaw: float
    roll: float
    reach: Reach
    sight: Sight
    seen: Array
    speed: Array
    target: Array
    upright: Array
    shake: Array
    shake_before: Array
    home: Array
    pedal: int
    picture: int


def describe_operator(
    law: OperatorLaw, config: OperatorConfig, period_s: float, round_trip_s: float = 0.0
) -> float:
    """Fill all numbers but places; answers the standard deviation of the tremor's noise [m].

    Args:
        law: Filled.
        config: Of the operator.
        period_s: Control period [s].
        round_trip_s: Delay of both channels, which the operator expects if it is to find out by itself [s].
    """
    if config.expected_delay_s == "auto":
        config = config.model_copy(update={"expected_delay_s": round_trip_s})
    take(law, config)
    take(law.grip, config)
    take(law.reach, config.reach)
    take(law.clutch, config.clutch)
    law.clutch.use = config.clutch.use
    law.period_s, law.jaw_step = period_s, period_s / config.jaw_time_s
    law.roll_step = period_s * config.roll_speed_rad_per_s
    law.blur = 1.0 - math.exp(-period_s / config.gaze_time_s)
    law.shake_last, law.shake_before, noise = resonance(config.tremor, period_s)
    return noise


@compiled
def operate(
    law: OperatorLaw,
    gains: Array,
    operator: Operator,
    memory: Array,
    t_s: float,
    tip: Array,
    handle: ConsoleState,
    mapping: Mapping,
    out: HandAction,
) -> None:
    """Look, decide, act: one period of a program of goals.

    Force on the handle: F = K (x_int + x_tremor - x_o) + D (v_int + v_tremor - v_o).

    Args:
        law: Its numbers.
        gains: Holds its goals.
        operator: Its state.
        memory: Holds its random draws.
        t_s: Time [s].
        tip: Remote tip as the screen shows it, already delayed (3,) [m].
        handle: The console.
        mapping: What the tip does when the handle moves.
        out: Filled with what the hand does.
    """
    if law.sight.use:
        see_picture(law.sight, operator.sight, memory, operator.picture)
    _look(law, gains, operator, memory, t_s, tip, handle, mapping)
    _decide(law, gains, operator, memory, t_s, handle, mapping)
    position, velocity = np.empty(3), np.empty(3)
    reach_at(operator.reach, t_s, out.intended, velocity)
    _close_jaw(law, gains, operator)
    noise = law.tremor + 3 * operator.shaken
    operator.shaken += 1
    shaken, before = operator.shake, operator.shake_before
    shake(law.shake_last, law.shake_before, memory[noise : noise + 3], shaken, before)
    for i in range(3):
        position[i] = out.intended[i] + shaken[i]
        velocity[i] += (shaken[i] - before[i]) / law.period_s
    _turn(law, gains, operator)
    turned = np.empty((3, 3))
    turn_grip(operator.upright, operator.roll, turned)
    hand_wrench(law.grip, position, velocity, turned, handle, out.wrench)
    out.jaw, out.goal, out.missed = operator.jaw, operator.index, operator.missed
    out.done, out.clutch = 1 if operator.phase == DONE else 0, operator.pedal


@compiled
def _goal(law: OperatorLaw, gains: Array, index: int) -> Array:
    """The row of a goal."""
    at = law.goals + GOAL * index
    return gains[at : at + GOAL]


@compiled
def _look(
    law: OperatorLaw,
    gains: Array,
    operator: Operator,
    memory: Array,
    t_s: float,
    tip: Array,
    handle: ConsoleState,
    mapping: Mapping,
) -> None:
    """Take the picture in through a low-pass; at first, begin the program."""
    if operator.begun:
        for i in range(3):
            change = law.blur * (tip[i] - operator.seen[i])
            operator.seen[i] += change
            operator.speed[i] += law.blur * (change / law.period_s - operator.speed[i])
        return
    operator.begun, operator.phase = 1, DONE
    operator.reach.start_s, operator.reach.duration_s = t_s - 1.0, 1.0
    for i in range(3):
        operator.seen[i], operator.reach.origin[i], operator.target[i] = tip[i], handle.position[i], math.nan
        operator.home[i] = handle.position[i]
        for k in range(3):
            operator.upright[i, k] = handle.rotation[i, k]
    if law.goal_count > 0:
        _begin(law, gains, operator, memory, 0, t_s, mapping)


@compiled
def _begin(
    law: OperatorLaw,
    gains: Array,
    operator: Operator,
    memory: Array,
    index: int,
    t_s: float,
    mapping: Mapping,
) -> None:
    """Take a goal up."""
    operator.index, operator.goal_start_s, operator.pedal = index, t_s, 0
    if index == law.goal_count:
        operator.phase = DONE
        return
    goal, stays = _goal(law, gains, index), True
    if law.sight.use:
        take_aim(law.sight, gains, operator.sight, memory, index)
    for i in range(3):
        place = goal[PLACE + i]
        if law.sight.use:
            place += operator.sight.shift[i]
        stays = stays and operator.target[i] == place
        operator.target[i] = place
    if stays and (law.sight.use or _distance(operator) <= goal[TOLERANCE]):
        operator.phase, operator.leave_s = DWELL, t_s + law.expected_delay_s + goal[DWELL_TIME]
        return
    _move(law, gains, operator, memory, t_s, mapping)


@compiled
def _move(
    law: OperatorLaw, gains: Array, operator: Operator, memory: Array, t_s: float, mapping: Mapping
) -> None:
    """Aim the hand so that the tip, seen where it is, would reach the goal; begin after the reaction."""
    origin, change, reach = np.empty(3), np.empty(3), operator.reach
    reach_at(reach, t_s, origin, change)
    for i in range(3):
        reach.origin[i], origin[i] = origin[i], operator.target[i] - operator.seen[i]
    motion_to_console(mapping, origin, change)
    for i in range(3):
        change[i] += reach.origin[i]
    width = 2.0 * _goal(law, gains, operator.index)[TOLERANCE] / mapping.scale
    aim(law.reach, reach, change, width, t_s + law.reaction_s, _scatter(law, operator, memory))
    operator.sight.moves += 1
    operator.phase = MOVE


@compiled
def _scatter(law: OperatorLaw, operator: Operator, memory: Array) -> Array:
    """The next row of the scatter (3,)."""
    noise = law.scatter + 3 * operator.scattered
    operator.scattered += 1
    return memory[noise : noise + 3]


@compiled
def _index(law: OperatorLaw, operator: Operator, memory: Array, t_s: float) -> None:
    """Press the pedal, and go back with the handle to where it was at first."""
    change, reach = np.empty(3), operator.reach
    origin = np.empty(3)
    reach_at(reach, t_s, origin, change)
    for i in range(3):
        reach.origin[i] = origin[i]
    start_s = t_s + law.clutch.fade_s
    aim(law.reach, reach, operator.home, _HOME_WIDTH_M, start_s, _scatter(law, operator, memory))
    operator.phase, operator.pedal = INDEX, 1


@compiled
def _decide(
    law: OperatorLaw,
    gains: Array,
    operator: Operator,
    memory: Array,
    t_s: float,
    handle: ConsoleState,
    mapping: Mapping,
) -> None:
    """Give a goal up, go on to the next phase, or correct."""
    if operator.phase == DONE:
        return
    goal, reach = _goal(law, gains, operator.index), operator.reach
    end_s = reach.start_s + reach.duration_s
    if t_s - operator.goal_start_s > goal[TIMEOUT]:
        operator.missed += 1
        _begin(law, gains, operator, memory, _instead(law, operator, memory), t_s, mapping)
    elif operator.phase == INDEX:
        if t_s >= end_s:
            operator.phase, operator.pedal = WATCH, 0
    elif operator.phase == MOVE:
        if leaves_no_room(law.clutch, reach, operator.home, handle):
            _index(law, operator, memory, t_s)
        elif t_s >= end_s:
            operator.phase = DWELL if goal[PUSH] == 1.0 else WATCH
            operator.leave_s = t_s + goal[DWELL_TIME]
    elif operator.phase == WATCH:
        rests = dot(operator.speed, operator.speed) < law.rest_speed_m_per_s * law.rest_speed_m_per_s
        if t_s < end_s + law.expected_delay_s or not rests:
            return
        if _distance(operator) <= goal[TOLERANCE] or _contents_itself(law, operator):
            operator.phase, operator.leave_s = DWELL, t_s + goal[DWELL_TIME]
        else:
            _move(law, gains, operator, memory, t_s, mapping)
    elif t_s >= operator.leave_s and operator.roll == goal[TURNED]:
        _begin(law, gains, operator, memory, _next(law, gains, operator, memory), t_s, mapping)
    elif goal[PUSH] == 0.0 and _distance(operator) > goal[TOLERANCE] and not _contents_itself(law, operator):
        _move(law, gains, operator, memory, t_s, mapping)


@compiled
def _contents_itself(law: OperatorLaw, operator: Operator) -> bool:
    """Whether it has corrected as often as one that looks does, and goes on with what it has reached."""
    return law.sight.use == 1 and operator.sight.moves > law.sight.corrections


@compiled
def _next(law: OperatorLaw, gains: Array, operator: Operator, memory: Array) -> int:
    """The goal after one that was reached."""
    if law.sight.use:
        return goal_after(law.sight, gains, operator.sight, memory, operator.index)
    return operator.index + 1


@compiled
def _instead(law: OperatorLaw, operator: Operator, memory: Array) -> int:
    """The goal after one that was given up: with sight the ring is sought again."""
    if law.sight.use:
        return once_more(law.sight, operator.sight, memory, operator.index // STEPS)
    return operator.index + 1


@compiled
def _distance(operator: Operator) -> float:
    """From the tip as it is seen to the target [m]."""
    square = 0.0
    for i in range(3):
        error = operator.target[i] - operator.seen[i]
        square += error * error
    return math.sqrt(square)


@compiled
def _close_jaw(law: OperatorLaw, gains: Array, operator: Operator) -> None:
    """Close the jaws as the goal, or the last one, wants it."""
    wanted = 0.0
    if law.goal_count > 0:
        wanted = _goal(law, gains, min(operator.index, law.goal_count - 1))[CLOSED]
    operator.jaw += min(max(wanted - operator.jaw, -law.jaw_step), law.jaw_step)


@compiled
def _turn(law: OperatorLaw, gains: Array, operator: Operator) -> None:
    """Turn the grip as the goal, or the last one, wants it."""
    if law.goal_count > 0:
        wanted = _goal(law, gains, min(operator.index, law.goal_count - 1))[TURNED]
        left = wanted - operator.roll
        if abs(left) <= law.roll_step:
            operator.roll = wanted
        else:
            operator.roll += law.roll_step if left > 0.0 else -law.roll_step
