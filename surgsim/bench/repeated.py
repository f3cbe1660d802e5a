"""Stages of a tick, each called many times from compiled code, on the arrays of a run.

They are called as the loop calls them: a part through its parameter, the rest directly.
"""

from typing import Any

from numba import types

from surgsim.compiled import as_parameter, compiled
from surgsim.plant.bore import Bore
from surgsim.plant.contacts import WATCH, Watch
from surgsim.plant.world import HOOKS, Hooks, advance_signature, function_types
from surgsim.simulate.safety import Guard, is_safe
from surgsim.simulate.ticks import TABLES, Run, Tables, ask_task
from surgsim.tick.arrays import (
    A1,
    A2,
    Array,
    Command,
    Control,
    Kernel,
    Resolved,
    Seen,
    World,
    law_signature,
    resolver_signature,
    task_signature,
    type_of,
)
from surgsim.tick.clock import thread_time
from surgsim.tick.nominal import copy_model, dynamics, kinematics


@compiled
def _models(times: int, c: Control) -> int:
    """The nominal model at the measured state, as a decision begins."""
    for _ in range(times):
        kinematics(c.measured, c.seen.q)
        if c.has_law:
            dynamics(c.measured, c.seen.v)
        copy_model(c.measured, c.seen)
    return times


@compiled
def _answers(times: int, gains: Array, seen: Seen, memory: Array, out: Array, call: Kernel) -> int:
    status = 0
    for _ in range(times):
        status += call(gains, seen, memory, out)
    return status


@compiled
def _clocks(times: int) -> float:
    """The two readings of the clock around a decision."""
    total = 0.0
    for _ in range(times):
        before = thread_time()
        total += thread_time() - before
    return total


@compiled
def _commands(times: int, run: Run, tables: Tables, c: Control, world: World, task: Kernel) -> int:
    status = 0
    for _ in range(times):
        world.t_s += world.dt_s
        status += ask_task(run, tables, c, world, task)
    return status


@compiled
def _checks(times: int, guard: Guard, watch: Watch, world: World, command: Command) -> int:
    """The joints are written each time, or the check could be drawn out of the loop."""
    passed = 0
    for _ in range(times):
        for i in range(world.q.size):
            world.q[i], world.v[i] = world.q_m[i], world.v_m[i]
        passed += is_safe(guard, watch, world, command)
    return passed


@compiled
def _periods(
    times: int, world: World, bore: Bore, hooks: Hooks, functions: tuple[Kernel, ...], call: Kernel
) -> int:
    status = 0
    for _ in range(times):
        status += call(world, bore, hooks, functions)
    return status


class Repeated:
    """The repeating functions for n joints; each takes how often, then the arguments of the stage."""

    def __init__(self, n: int) -> None:
        control, world, seen = type_of(Control, n), type_of(World, n), type_of(Seen, n)

        def of(kernel: Any, *arguments: Any) -> Any:
            return as_parameter(kernel, types.int64(types.int64, *arguments))

        law, resolver = types.FunctionType(law_signature(n)), types.FunctionType(resolver_signature(n))
        advance, task = types.FunctionType(advance_signature(n)), types.FunctionType(task_signature())
        self.models = of(_models, control)
        self.laws = of(_answers, A1, seen, A1, A2, law)
        self.resolvers = of(_answers, A1, seen, A1, type_of(Resolved, n), resolver)
        self.commands = of(_commands, type_of(Run, 0), TABLES, control, world, task)
        self.checks = of(_checks, type_of(Guard, n), WATCH, world, type_of(Command, 0))
        self.periods = of(_periods, world, type_of(Bore, n), HOOKS, function_types(n), advance)
        self.clocks = as_parameter(_clocks, types.float64(types.int64))
