"""The control loop as one compiled function: command, safety, decision, row, plant, tick after tick.

It holds no Python lock, calls MuJoCo by symbol and the parts' kernels by address. A part that is
Python by nature is one of the kernels too: a trampoline that enters Python (`surgsim.tick.python_part`).
"""

import math
from functools import cache
from typing import Any, ClassVar

from numba import types

from surgsim.array import Array
from surgsim.compiled import call_at, compiled
from surgsim.control.decision import ESTIMATOR, INSTRUMENT, decide, forget, measure
from surgsim.plant.bore import Bore
from surgsim.plant.contacts import Watch
from surgsim.plant.shaft import nearest_of_shaft
from surgsim.plant.world import Hooks
from surgsim.simulate.safety import Guard, is_safe
from surgsim.simulate.stop import Stop, brake
from surgsim.tick.algebra import dot, norm, times
from surgsim.tick.arrays import (
    Control,
    Feedback,
    Numbers,
    Record,
    World,
    type_of,
)
from surgsim.tick.clock import thread_time
from surgsim.tick.nominal import kinematics
from surgsim.tick.status import GOES_ON, INFEASIBLE, RANK_LOST, TOLD
from surgsim.tick.views import numbers, vector

GOING, UNSAFE, FAILED, NOT_FINITE, DONE, TASK_TOLD, PLANT_TOLD, ARMS_TOUCH = range(8)
"""Why `run_ticks` came back: nothing ended, or what did; the last one is of several arms alone."""


class Progress(Record):
    """Where a run is.

    Attributes:
        reason: Why the loop came back.
        status: The controller's status then.
        rows: Rows written.
        last: The last tick.
        infeasible: Infeasible ticks in a row.
        most_infeasible: How many may be.
        reacts: Whether the task is given feedback.
        uses_torque: Whether the plant takes torques.
        clock_every: The controller's time is taken in every such tick; the clock costs as much as a law.
        shares_port: Whether the estimated trocar is recorded.
        task_values: Columns of the task.
        resolver_values: Columns of the resolver.
    """

    reason: int
    status: int
    rows: int
    last: int
    infeasible: int
    most_infeasible: int
    reacts: int
    uses_torque: int
    clock_every: int
    shares_port: int
    task_values: int
    resolver_values: int


class RowPlaces(Record):
    """Where the blocks of a row begin, by their names in the trace; the last four are groups of blocks."""

    t: int
    q: int
    v: int
    tau: int
    qdot_ref: int
    q_ref: int
    tip: int
    tip_ref: int
    tip_believed: int
    rcm_error_believed: int
    wrist: int
    trocar: int
    resolver_residual: int
    saturated_joints: int
    control_time: int
    infeasible: int
    stopped: int
    terms: int
    task: int
    controller: int
    plant: int


class Run(Record):
    """The state of a run in one piece.

    Attributes:
        progress: Where it is.
        feedback: What the task is told.
        at: Where the blocks of a row begin.
        task: Address of the task's kernel.
        advance: Of the plant's.
        rows: Address of the trace so far; what is never written stays NaN.
        columns: Width of a row.
        task_gains: The task's numbers.
        task_memory: Its memory.
    """

    ADDRESSES: ClassVar[frozenset[str]] = frozenset(("task", "advance", "rows"))
    progress: Progress
    feedback: Feedback
    at: RowPlaces
    task: int
    advance: int
    rows: int
    columns: int
    task_gains: Numbers
    task_memory: Numbers


@cache
def run_signature(n: int) -> Any:
    """Signature of `run_ticks` for n joints."""
    records = [type_of(kind, n) for kind in (Control, World, Bore, Guard, Stop, Watch)]
    return types.int64(types.int64, type_of(Run, 0), *records, type_of(Hooks, 0))


@cache
def ask_signature(n: int) -> Any:
    """Signature of `ask_task` for n joints."""
    return types.int64(type_of(Run, 0), type_of(Control, n), type_of(World, n))


@cache
def hold_signature(n: int) -> Any:
    """Signature of `hold_ticks` for n joints."""
    records = [type_of(kind, n) for kind in (Control, World, Bore, Stop)]
    return types.int64(types.int64, type_of(Run, 0), *records, type_of(Hooks, 0))


@compiled
def _put(row: Array, at: int, values: Array) -> None:
    for i in range(values.size):
        row[at + i] = values[i]


@compiled
def _put_some(row: Array, at: int, values: Array, count: int) -> None:
    for i in range(count):
        row[at + i] = values[i]


@compiled
def _begin_row(run: Run, world: World, values: Array) -> Array:
    """The next row with what is known of every tick, also of one that ends the run or follows."""
    row, at = vector(run.rows + 8 * run.columns * run.progress.rows, run.columns), run.at
    run.progress.rows += 1
    row[at.t] = world.t_s
    _put(row, at.q, world.q)
    _put(row, at.v, world.v)
    _put(row, at.tip, world.p_WT)
    _put(row, at.wrist, world.p_WR)
    if world.shaft_end != world.tip and world.trocar >= 0:
        nearest_of_shaft(world, row[at.wrist : at.wrist + 3])
    _put(row, at.trocar, world.p_WC)
    row[at.infeasible] = 0.0
    row[at.stopped] = 0.0
    _put(row, at.plant, values)
    return row


@compiled
def _record_torque(row: Array, at: RowPlaces, limit: Array, torque: Array) -> None:
    """The torque cut at the limits, and how many joints were cut."""
    cut = 0
    for i in range(torque.size):
        inside = min(max(torque[i], -limit[i]), limit[i])
        cut += inside != torque[i]
        row[at.tau + i] = inside
    row[at.saturated_joints] = cut


@compiled
def _record_belief(row: Array, at: RowPlaces, c: Control) -> None:
    """Where the controller takes tip and shaft to be: its model at the measured joint positions.

    `c.seen` is that also where a resolver is evaluated at the joint reference.
    """
    if c.who == INSTRUMENT:
        return
    _put(row, at.tip_believed, c.seen.p_WT)
    if c.seen.has_trocar and c.who != ESTIMATOR:
        row[at.rcm_error_believed] = norm(c.seen.rcm_error)


@compiled
def _record(run: Run, row: Array, c: Control, limit: Array, took: float) -> None:
    """What the controller decided."""
    p, at = run.progress, run.at
    _put(row, at.qdot_ref, c.resolved.qdot)
    _put(row, at.q_ref, c.q_ref)
    row[at.resolver_residual] = c.resolved.residual
    row[at.control_time] = took
    _put_some(row, at.controller, c.resolved.values, p.resolver_values)
    if p.shares_port:
        _put(row, at.controller + p.resolver_values, c.port[0])
    if p.uses_torque:
        _record_torque(row, at, limit, c.torque)
        _put(row, at.terms, numbers(c.minds.terms))


@compiled
def _is_finite(values: Array) -> bool:
    return math.isfinite(dot(values, values))


@compiled
def ask_task(run: Run, c: Control, world: World) -> int:
    """The task's command for the present state, once a tick."""
    told = run.feedback
    told.t_s = world.t_s
    if run.progress.reacts:
        model = c.measured
        kinematics(model, world.q_m)
        times(model.Jv_WT, world.v_m, told.v_WT)
        times(model.Jw_WT, world.v_m, told.w_WT)
        for i in range(3):
            told.p_WT[i], told.f_T[i] = model.p_WT[i], world.f_T_m[i]
            for k in range(3):
                told.R_WT[i, k] = model.R_WT[i, k]
    gains, memory = numbers(run.task_gains), numbers(run.task_memory)
    status: int = call_at(run.task, gains, told, memory, c.command)
    return status


@compiled
def _tell(world: World, torque: Array, qdot: Array, jaw: float) -> None:
    """Hand the command to the plant."""
    for i in range(torque.size):
        world.torque[i], world.qdot[i], world.q_cmd[i] = torque[i], qdot[i], math.nan
    world.jaw = jaw


@compiled
def _refer(world: World, c: Control) -> None:
    """Hand the arm's own loop the joint reference as it will be at the end of the period."""
    seen = c.seen
    for i in range(world.q_cmd.size):
        moved = c.q_ref[i] + seen.dt_s * c.resolved.qdot[i]
        world.q_cmd[i] = min(max(moved, seen.q_min[i]), seen.q_max[i])


@compiled
def _is_last(p: Progress, c: Control, world: World) -> bool:
    return world.tick >= p.last or c.command.finished != 0


@compiled
def _has_no_answer(status: int) -> bool:
    return status in (INFEASIBLE, RANK_LOST)


@compiled
def _bridges(p: Progress, c: Control, world: World, status: int) -> bool:
    """Whether the tick in which the controller has no answer is bridged by braking."""
    infeasible = _has_no_answer(status)
    if infeasible:
        p.infeasible += 1
    return infeasible and p.infeasible <= p.most_infeasible and not _is_last(p, c, world)


@compiled
def decide_tick(
    run: Run, c: Control, world: World, guard: Guard, stop: Stop, watch: Watch, hooks: Hooks
) -> int:
    """A tick up to the command that the plant is given; why the run ends with it, or `GOING`.

    In the last tick of the task the plant is told too: one of several arms may have to go on.
    """
    p, at = run.progress, run.at
    row = _begin_row(run, world, numbers(hooks.values))
    _put(row, at.tip_ref, c.command.p_WTd)
    _put_some(row, at.task, c.command.values, p.task_values)
    if not is_safe(guard, watch, world, c.command):
        return UNSAFE
    measure(c.seen, world)
    timed = world.tick % p.clock_every == 0
    before = thread_time() if timed else math.nan
    status = decide(c)
    took = thread_time() - before if timed else math.nan
    _record_belief(row, at, c)
    if status == GOES_ON:
        p.infeasible = 0
        stop.begun = 0
        _record(run, row, c, world.tau_max, took)
        if not _is_finite(c.torque) or (c.commands_reference and not _is_finite(c.resolved.qdot)):
            return NOT_FINITE
        _tell(world, c.torque, c.resolved.qdot, c.command.jaw)
        if c.commands_reference:
            _refer(world, c)
        return DONE if _is_last(p, c, world) else GOING
    row[at.infeasible] = 1.0 if _has_no_answer(status) else 0.0
    if status == TOLD or not _bridges(p, c, world, status):
        p.status = status
        return FAILED
    forget(c)  # what it remembers is not what the arm did
    brake(stop, world)
    _put(row, at.qdot_ref, stop.qdot)
    _put(row, at.q_ref, stop.q)
    if p.uses_torque:
        _record_torque(row, at, world.tau_max, stop.torque)
    _tell(world, stop.torque, stop.qdot, c.command.jaw)
    return GOING


@compiled
def run_ticks(
    ticks: int,
    run: Run,
    c: Control,
    world: World,
    bore: Bore,
    guard: Guard,
    stop: Stop,
    watch: Watch,
    hooks: Hooks,
) -> int:
    """Run up to `ticks` ticks; how many rows were begun. `run.progress` says why it came back."""
    p = run.progress
    p.reason = GOING
    for k in range(ticks):
        reason = decide_tick(run, c, world, guard, stop, watch, hooks)
        if reason != GOING:
            p.reason = reason
            return k + 1
        status: int = call_at(run.advance, world, bore, hooks)
        if status != GOES_ON:
            p.reason, p.status = PLANT_TOLD, status
            return k + 1
        status = ask_task(run, c, world)
        if status != GOES_ON:
            p.reason, p.status = TASK_TOLD, status
            return k + 1
    return ticks


@compiled
def brake_tick(run: Run, c: Control, world: World, stop: Stop) -> bool:
    """A tick of the stop up to the torque that the plant is given; False if the state diverged."""
    p, at = run.progress, run.at
    if not (_is_finite(world.q_m) and _is_finite(world.v_m)):
        return False
    brake(stop, world)
    last = vector(run.rows + 8 * run.columns * (p.rows - 1), run.columns)
    if last[at.stopped] == 1.0:
        _record_torque(last, at, world.tau_max, stop.torque)
    _tell(world, stop.torque, stop.qdot, c.command.jaw)
    return True


@compiled
def held_row(run: Run, world: World, stop: Stop, hooks: Hooks) -> None:
    """The row after a tick of the stop."""
    row = _begin_row(run, world, numbers(hooks.values))
    row[run.at.stopped] = 1.0
    _put(row, run.at.q_ref, stop.q)


@compiled
def hold_ticks(ticks: int, run: Run, c: Control, world: World, bore: Bore, stop: Stop, hooks: Hooks) -> int:
    """The stop after the outcome: rows without a command, until the state diverges; their number."""
    p = run.progress
    for k in range(ticks):
        if not brake_tick(run, c, world, stop):
            return k
        status: int = call_at(run.advance, world, bore, hooks)
        if status != GOES_ON:
            p.reason, p.status = PLANT_TOLD, status
            return k
        held_row(run, world, stop, hooks)
    return ticks
