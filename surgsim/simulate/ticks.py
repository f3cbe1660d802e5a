"""The control loop as one compiled function: command, safety, decision, row, plant, tick after tick.

It holds no Python lock, calls MuJoCo by symbol and is given the parts' kernels as parameters. A part that is
Python by nature is one of the kernels too: a trampoline that enters Python (`surgsim.tick.python_part`).
"""

import math
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from surgsim.compiled import compiled
from surgsim.control.decision import MINDS, Minds, decide, part_types
from surgsim.plant.bore import Bore
from surgsim.plant.contacts import WATCH, Watch
from surgsim.plant.world import HOOKS, Hooks, advance_signature, function_types
from surgsim.simulate.safety import Guard, is_safe
from surgsim.simulate.stop import Stop, brake
from surgsim.tick.algebra import dot, times
from surgsim.tick.arrays import (
    A1,
    A2,
    I1,
    Control,
    Feedback,
    Kernel,
    Record,
    Seen,
    World,
    task_signature,
    type_of,
)
from surgsim.tick.clock import thread_time
from surgsim.tick.nominal import kinematics
from surgsim.tick.status import GOES_ON, INFEASIBLE, RANK_LOST, TOLD

Array = NDArray[np.float64]
Ids = NDArray[np.int64]

GOING, UNSAFE, FAILED, NOT_FINITE, DONE, TASK_TOLD, PLANT_TOLD = range(7)
"""Why `run_ticks` came back: nothing ended, or what did."""


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
    shares_port: int
    task_values: int
    resolver_values: int


(
    T,
    Q,
    V,
    TAU,
    QDOT_REF,
    Q_REF,
    TIP_AT,
    TIP_REF,
    WRIST,
    TROCAR,
    RESIDUAL,
    SATURATED,
    CONTROL_TIME,
    INFEASIBLE_AT,
    STOPPED,
    TERMS,
    TASK_AT,
    CONTROLLER_AT,
    PLANT_AT,
) = range(19)
"""Places in `Tables.at`: where the blocks of a row begin."""
ROW_BLOCKS = (
    "t",
    "q",
    "v",
    "tau",
    "qdot_ref",
    "q_ref",
    "tip",
    "tip_ref",
    "wrist",
    "trocar",
    "resolver_residual",
    "saturated_joints",
    "control_time",
    "infeasible",
    "stopped",
    "terms",
    "task",
    "controller",
    "plant",
)
"""Their names, the last four those of groups."""


class Tables(NamedTuple):
    """Arrays of a run whose sizes differ from run to run.

    Attributes:
        rows: The trace so far; what is never written stays NaN (ticks, columns).
        at: Where the blocks of a row begin, see `T` and the following (19,).
        task_gains: The task's numbers.
        task_memory: Its memory.
        watch: Forbidden contacts.
        hooks: The hooks of the plant's parts.
        minds: Numbers and memories of the controller's parts.
    """

    rows: Array
    at: Ids
    task_gains: Array
    task_memory: Array
    watch: Watch
    hooks: Hooks
    minds: Minds


class Run(Record):
    """The state of a run in one piece.

    Attributes:
        progress: Where it is.
        feedback: What the task is told.
    """

    progress: Progress
    feedback: Feedback


TABLES = types.NamedTuple([A2, I1, A1, A1, WATCH, HOOKS, MINDS], Tables)  # type: ignore[no-untyped-call]


@cache
def run_signature(n: int) -> Any:
    """Signature of `run_ticks` for n joints."""
    records = [type_of(kind, n) for kind in (Control, World, Bore, Guard, Stop)]
    return types.int64(
        types.int64,
        type_of(Run, 0),
        TABLES,
        *records,
        types.FunctionType(task_signature()),
        *part_types(n),
        types.FunctionType(advance_signature(n)),
        function_types(n),
    )


@cache
def ask_signature(n: int) -> Any:
    """Signature of `ask_task` for n joints."""
    task = types.FunctionType(task_signature())
    return types.int64(type_of(Run, 0), TABLES, type_of(Control, n), type_of(World, n), task)


@cache
def hold_signature(n: int) -> Any:
    """Signature of `hold_ticks` for n joints."""
    records = [type_of(kind, n) for kind in (Control, World, Bore, Stop)]
    advance = types.FunctionType(advance_signature(n))
    return types.int64(types.int64, type_of(Run, 0), TABLES, *records, advance, function_types(n))


@compiled
def _put(row: Array, at: int, values: Array) -> None:
    for i in range(values.size):
        row[at + i] = values[i]


@compiled
def _put_some(row: Array, at: int, values: Array, count: int) -> None:
    for i in range(count):
        row[at + i] = values[i]


@compiled
def _begin_row(p: Progress, rows: Array, at: Ids, world: World, values: Array) -> Array:
    """The next row with what is known of every tick, also of one that ends the run or follows."""
    row: Array = rows[p.rows]
    p.rows += 1
    row[at[T]] = world.t_s
    _put(row, at[Q], world.q)
    _put(row, at[V], world.v)
    _put(row, at[TIP_AT], world.p_WT)
    _put(row, at[WRIST], world.p_WR)
    _put(row, at[TROCAR], world.p_WC)
    row[at[INFEASIBLE_AT]] = 0.0
    row[at[STOPPED]] = 0.0
    _put(row, at[PLANT_AT], values)
    return row


@compiled
def _record_torque(row: Array, at: Ids, limit: Array, torque: Array) -> None:
    """The torque cut at the limits, and how many joints were cut."""
    cut = 0
    for i in range(torque.size):
        inside = min(max(torque[i], -limit[i]), limit[i])
        cut += inside != torque[i]
        row[at[TAU] + i] = inside
    row[at[SATURATED]] = cut


@compiled
def _record(p: Progress, row: Array, at: Ids, c: Control, limit: Array, terms: Array, took: float) -> None:
    """What the controller decided."""
    _put(row, at[QDOT_REF], c.resolved.qdot)
    _put(row, at[Q_REF], c.q_ref)
    row[at[RESIDUAL]] = c.resolved.residual
    row[at[CONTROL_TIME]] = took
    _put_some(row, at[CONTROLLER_AT], c.resolved.values, p.resolver_values)
    if p.shares_port:
        _put(row, at[CONTROLLER_AT] + p.resolver_values, c.port[0])
    if p.uses_torque:
        _record_torque(row, at, limit, c.torque)
        for k in range(terms.shape[0]):
            _put(row, at[TERMS] + k * c.torque.size, terms[k])


@compiled
def _measure(seen: Seen, world: World) -> None:
    """Hand what is measured to the controller."""
    seen.t_s = world.t_s
    for i in range(world.q.size):
        seen.q[i], seen.v[i], seen.tau[i] = world.q_m[i], world.v_m[i], world.tau_m[i]
    for i in range(3):
        seen.f_T[i], seen.p_WC[i] = world.f_T_m[i], world.p_WC_m[i]
        seen.v_WC[i], seen.a_WC[i] = world.v_WC_m[i], 0.0


@compiled
def _is_finite(values: Array) -> bool:
    return math.isfinite(dot(values, values))


@compiled
def ask_task(run: Run, tables: Tables, c: Control, world: World, task: Kernel) -> int:
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
    status: int = task(tables.task_gains, told, tables.task_memory, c.command)
    return status


@compiled
def _act(
    torque: Array,
    qdot: Array,
    jaw: float,
    world: World,
    bore: Bore,
    hooks: Hooks,
    advance: Kernel,
    functions: tuple[Kernel, ...],
) -> int:
    """Hand the command to the plant and let one period pass."""
    for i in range(torque.size):
        world.torque[i], world.qdot[i] = torque[i], qdot[i]
    world.jaw = jaw
    status: int = advance(world, bore, hooks, functions)
    return status


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
def run_ticks(
    ticks: int,
    run: Run,
    tables: Tables,
    c: Control,
    world: World,
    bore: Bore,
    guard: Guard,
    stop: Stop,
    task: Kernel,
    estimator: Kernel,
    resolver: Kernel,
    law: Kernel,
    advance: Kernel,
    functions: tuple[Kernel, ...],
) -> int:
    """Run up to `ticks` ticks; how many rows were begun. `run.progress` says why it came back."""
    p, at, hooks, minds = run.progress, tables.at, tables.hooks, tables.minds
    p.reason = GOING
    for k in range(ticks):
        row = _begin_row(p, tables.rows, at, world, hooks.values)
        _put(row, at[TIP_REF], c.command.p_WTd)
        _put_some(row, at[TASK_AT], c.command.values, p.task_values)
        if not is_safe(guard, tables.watch, world, c.command):
            p.reason = UNSAFE
            return k + 1
        _measure(c.seen, world)
        before = thread_time()
        status = decide(c, minds, estimator, resolver, law)
        took = thread_time() - before
        if status == GOES_ON:
            p.infeasible = 0
            stop.begun = 0
            _record(p, row, at, c, world.tau_max, minds.terms, took)
            if not _is_finite(c.torque):
                p.reason = NOT_FINITE
                return k + 1
            if _is_last(p, c, world):
                p.reason = DONE
                return k + 1
            status = _act(c.torque, c.resolved.qdot, c.command.jaw, world, bore, hooks, advance, functions)
        else:
            row[at[INFEASIBLE_AT]] = 1.0 if _has_no_answer(status) else 0.0
            if status == TOLD or not _bridges(p, c, world, status):
                p.reason, p.status = FAILED, status
                return k + 1
            c.seen.first = 1  # what it remembers is not what the arm did
            brake(stop, world)
            _put(row, at[QDOT_REF], stop.qdot)
            _put(row, at[Q_REF], stop.q)
            if p.uses_torque:
                _record_torque(row, at, world.tau_max, stop.torque)
            status = _act(stop.torque, stop.qdot, c.command.jaw, world, bore, hooks, advance, functions)
        if status != GOES_ON:
            p.reason, p.status = PLANT_TOLD, status
            return k + 1
        status = ask_task(run, tables, c, world, task)
        if status != GOES_ON:
            p.reason, p.status = TASK_TOLD, status
            return k + 1
    return ticks


@compiled
def hold_ticks(
    ticks: int,
    run: Run,
    tables: Tables,
    c: Control,
    world: World,
    bore: Bore,
    stop: Stop,
    advance: Kernel,
    functions: tuple[Kernel, ...],
) -> int:
    """The stop after the outcome: rows without a command, until the state diverges; their number."""
    p, at, hooks = run.progress, tables.at, tables.hooks
    for k in range(ticks):
        if not (_is_finite(world.q_m) and _is_finite(world.v_m)):
            return k
        brake(stop, world)
        last = tables.rows[p.rows - 1]
        if last[at[STOPPED]] == 1.0:
            _record_torque(last, at, world.tau_max, stop.torque)
        status = _act(stop.torque, stop.qdot, c.command.jaw, world, bore, hooks, advance, functions)
        if status != GOES_ON:
            p.reason, p.status = PLANT_TOLD, status
            return k
        row = _begin_row(p, tables.rows, at, world, hooks.values)
        row[at[STOPPED]] = 1.0
        _put(row, at[Q_REF], stop.q)
    return ticks
