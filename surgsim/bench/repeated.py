"""Stages of a tick, each called many times from compiled code, on the arrays of a run.

They are called as the loop calls them: a part by its address, the rest directly.
"""

from typing import Any

from numba import types

from surgsim.compiled import as_parameter, call_at, compiled
from surgsim.plant.bore import Bore
from surgsim.plant.contacts import Watch
from surgsim.plant.world import Hooks
from surgsim.simulate.safety import Guard, is_safe
from surgsim.simulate.ticks import Run, ask_task
from surgsim.tick.arrays import Command, Control, World, type_of
from surgsim.tick.clock import thread_time
from surgsim.tick.nominal import copy_model, dynamics, kinematics
from surgsim.tick.views import doubles, numbers


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
def _ports(times: int, c: Control) -> int:
    minds, port, status = c.minds, doubles(c.port.ctypes.data, 3, 3), 0
    gains, memory = numbers(minds.port_gains), numbers(minds.port_memory)
    for _ in range(times):
        status += call_at(minds.port, gains, c.seen, memory, port)
    return status


@compiled
def _resolvers(times: int, c: Control) -> int:
    minds, status = c.minds, 0
    gains, memory = numbers(minds.resolver_gains), numbers(minds.resolver_memory)
    for _ in range(times):
        if c.at_reference:
            status += call_at(minds.resolver, gains, c.referred, memory, c.resolved)
        else:
            status += call_at(minds.resolver, gains, c.seen, memory, c.resolved)
    return status


@compiled
def _laws(times: int, c: Control) -> int:
    minds, n, status = c.minds, c.torque.size, 0
    gains, memory = numbers(minds.law_gains), numbers(minds.law_memory)
    terms = doubles(minds.terms.address, minds.terms.length // n, n)
    for _ in range(times):
        status += call_at(minds.law, gains, c.seen, memory, terms)
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
def _commands(times: int, run: Run, c: Control, world: World) -> int:
    status = 0
    for _ in range(times):
        world.t_s += world.dt_s
        status += ask_task(run, c, world)
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
def _periods(times: int, run: Run, world: World, bore: Bore, hooks: Hooks) -> int:
    status = 0
    for _ in range(times):
        status += call_at(run.advance, world, bore, hooks)
    return status


class Repeated:
    """The repeating functions for n joints; each takes how often, then the arguments of the stage."""

    def __init__(self, n: int) -> None:
        control, world, run = type_of(Control, n), type_of(World, n), type_of(Run, 0)

        def of(kernel: Any, *arguments: Any) -> Any:
            return as_parameter(kernel, types.int64(types.int64, *arguments))

        self.models, self.ports = of(_models, control), of(_ports, control)
        self.resolvers, self.laws = of(_resolvers, control), of(_laws, control)
        self.commands = of(_commands, run, control, world)
        self.checks = of(_checks, type_of(Guard, n), type_of(Watch, n), world, type_of(Command, 0))
        self.periods = of(_periods, run, world, type_of(Bore, n), type_of(Hooks, 0))
        self.clocks = as_parameter(_clocks, types.float64(types.int64))
