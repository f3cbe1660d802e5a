"""The control loop of several arms: each decides as in `surgsim.simulate.ticks`, then time passes for all."""

from functools import cache
from typing import Any, ClassVar

from numba import types

from surgsim.compiled import call_at, compiled
from surgsim.plant.between import Between, arms_are_clear
from surgsim.plant.contacts import Watch
from surgsim.plant.several import Shared, advance_several
from surgsim.plant.world import Hooks
from surgsim.simulate.safety import Guard
from surgsim.simulate.stop import Stop
from surgsim.simulate.ticks import (
    ARMS_TOUCH,
    DONE,
    GOING,
    PLANT_TOLD,
    TASK_TOLD,
    Run,
    ask_task,
    brake_tick,
    decide_tick,
    held_row,
)
from surgsim.tick.arrays import Control, Record, World, type_of
from surgsim.tick.status import GOES_ON
from surgsim.tick.views import record_at, words

DECIDED, ASKED, BRAKED, ROWED = range(4)
"""What an arm is told to do in a tick."""
ENTRY = 8
"""Words of an arm in the table."""


class Arms(Record):
    """Several arms on their way.

    Attributes:
        table: Address of the arms: for each the address of `arm_tick` for its joints, and those of its
            records in the order of that kernel's parameters (count, 8).
        reasons: Address of why each arm's tick ends the run, or `GOING` (count,).
        count: Arms.
        reason: Why the loop came back.
        who: The arm that ended the run.
        status: What it, or the plant, told.
    """

    ADDRESSES: ClassVar[frozenset[str]] = frozenset(("table", "reasons"))
    table: int
    reasons: int
    count: int
    reason: int
    who: int
    status: int


@cache
def arm_tick_signature(n: int) -> Any:
    """Signature of `arm_tick` for n joints."""
    records = [type_of(kind, n) for kind in (Control, World, Guard, Stop, Watch)]
    return types.int64(types.int64, type_of(Run, 0), *records, type_of(Hooks, 0))


@cache
def arms_signature() -> Any:
    """Signature of `run_arms` and `hold_arms`."""
    return types.int64(types.int64, type_of(Arms, 0), type_of(Shared, 0), type_of(Between, 0))


@cache
def ask_arms_signature() -> Any:
    """Signature of `ask_arms`."""
    return types.int64(type_of(Arms, 0))


@compiled
def arm_tick(
    what: int, run: Run, c: Control, world: World, guard: Guard, stop: Stop, watch: Watch, hooks: Hooks
) -> int:
    """What one arm does at a place of the tick."""
    if what == DECIDED:
        return decide_tick(run, c, world, guard, stop, watch, hooks)
    if what == ASKED:
        return ask_task(run, c, world)
    if what == BRAKED:
        return 1 if brake_tick(run, c, world, stop) else 0
    held_row(run, world, stop, hooks)
    return GOES_ON


@compiled
def _arm(arms: Arms, i: int, what: int) -> int:
    """Let arm i do it."""
    at = words(arms.table + 8 * ENTRY * i, ENTRY)
    status: int = call_at(
        at[0],
        what,
        record_at(at[1]),
        record_at(at[2]),
        record_at(at[3]),
        record_at(at[4]),
        record_at(at[5]),
        record_at(at[6]),
        record_at(at[7]),
    )
    return status


@compiled
def _decide(arms: Arms, between: Between) -> None:
    """All arms decide, from the same instant; `arms.reason` says whether that ends the run.

    An outcome of an arm comes before contact between two. The run is done when every arm is.
    """
    reasons = words(arms.reasons, arms.count)
    arms.reason, done = GOING, 0
    for i in range(arms.count):
        reasons[i] = _arm(arms, i, DECIDED)
        done += reasons[i] == DONE
        if arms.reason == GOING and reasons[i] != GOING and reasons[i] != DONE:
            arms.reason, arms.who = reasons[i], i
    if arms.reason == GOING and not arms_are_clear(between):
        arms.reason = ARMS_TOUCH
    if arms.reason == GOING and done == arms.count:
        arms.reason = DONE


@compiled
def run_arms(ticks: int, arms: Arms, shared: Shared, between: Between) -> int:
    """Run up to `ticks` ticks; how many rows were begun. `arms.reason` says why it came back."""
    for k in range(ticks):
        _decide(arms, between)
        if arms.reason != GOING:
            return k + 1
        status = advance_several(shared)
        if status != GOES_ON:
            arms.reason, arms.who, arms.status = PLANT_TOLD, shared.who, status
            return k + 1
        ask_arms(arms)
        if arms.reason != GOING:
            return k + 1
    return ticks


@compiled
def ask_arms(arms: Arms) -> int:
    """Every task's command for the present state; one that tells something ends the run."""
    arms.reason = GOING
    for i in range(arms.count):
        status = _arm(arms, i, ASKED)
        if status != GOES_ON and arms.reason == GOING:
            arms.reason, arms.who, arms.status = TASK_TOLD, i, status
    return GOES_ON


@compiled
def hold_arms(ticks: int, arms: Arms, shared: Shared, between: Between) -> int:
    """The stop of all arms after an outcome, until a state diverges; the number of rows."""
    for k in range(ticks):
        for i in range(arms.count):
            if not _arm(arms, i, BRAKED):
                return k
        status = advance_several(shared)
        if status != GOES_ON:
            arms.reason, arms.who, arms.status = PLANT_TOLD, shared.who, status
            return k
        for i in range(arms.count):
            _arm(arms, i, ROWED)
    return ticks
