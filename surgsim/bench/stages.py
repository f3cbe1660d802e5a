"""What the stages of a tick cost, at states of a real run.

The run goes on by chunks. After each one, every stage is called as often as the chunk has ticks, from
compiled code, and the run is put back to where it was: the loop itself is not touched, and has no clock more.
"""

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np

from surgsim.bench.cases import Case
from surgsim.bench.chunks import CHUNK, thread_time_of
from surgsim.bench.repeated import Repeated
from surgsim.bench.ticks import BareSteps, Row
from surgsim.compiled import as_parameter
from surgsim.errors import SurgsimError
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import prepare
from surgsim.simulate.ticks import run_signature, run_ticks

STAGES = ("model", "port", "resolver", "law", "task", "mj_step", "plant", "safety", "clock", "enter", "rest")
"""Stages whose times add up to the tick.

Nominal model, port estimator, resolver, torque law, the task's command, MuJoCo, what else the plant does,
safety limits, the two readings of the clock where they are taken, entering the loop once a chunk, and the
rest: correction by an instrument estimator, kinematics of the remote centre, velocity bounds, the trace's
row. As what is left of the tick, it carries the others' errors.
"""


def measure_stages(case: Case, duration_s: float) -> Row:
    """A case's stages, each the median over the chunks of a run [us].

    Args:
        case: What is run.
        duration_s: Simulated time of the run [s].

    Raises:
        SurgsimError: If the run ends before two chunks of ticks.
    """
    setup = prepare(case.scenario())
    simulation, steps = Simulation(setup), BareSteps(setup, CHUNK)
    calls = _calls(simulation, setup.arm.limits.q_min.size, uses_torque=setup.scenario.plant.uses_torque)
    enter = as_parameter(run_ticks, run_signature(setup.arm.limits.q_min.size))
    period = setup.scenario.simulation.control_period_s
    found: list[dict[str, float]] = []
    for _ in itertools.count():
        if simulation.time_s + CHUNK * period > duration_s:
            break
        tick = thread_time_of(lambda: simulation.advance(CHUNK))
        if simulation.ended:
            break
        times = {"tick": tick}
        steps.follow()
        times["enter"] = thread_time_of(lambda: enter(0, *simulation.arguments))
        times["mj_step"] = thread_time_of(steps) if setup.scenario.plant.uses_torque else 0.0
        here = simulation.snapshot()
        for name, call in calls.items():
            times[name] = _time_of(call)
            simulation.restore(here)
        found.append(times)
    if len(found) < 2:
        raise SurgsimError(f"{case.name}: the run ended before two chunks of {CHUNK} ticks")
    clock_every = int(simulation.arguments[0].progress.clock_every)
    medians = {name: 1e6 / CHUNK * float(np.median([t[name] for t in found[1:]])) for name in found[0]}
    medians["clock"] /= clock_every
    return {"case": case.name, "tick": medians["tick"], **_shares(medians)}


def _time_of(call: Callable[[int], object]) -> float:
    """Time of `CHUNK` repetitions [s], without that of entering the repeating function."""
    call(0)
    entering = thread_time_of(lambda: call(0))
    return max(0.0, thread_time_of(lambda: call(CHUNK)) - entering)


def _shares(t: dict[str, float]) -> dict[str, float]:
    """Times of `STAGES` from those that were measured, some of which hold others."""
    alone = ("model", "port", "resolver", "law", "task", "mj_step", "safety", "clock", "enter")
    known = {**{name: t[name] for name in alone}, "plant": t["period"] - t["mj_step"]}
    known["rest"] = t["tick"] - sum(known.values())
    return {name: known[name] for name in STAGES}


def _calls(simulation: Simulation, n: int, *, uses_torque: bool) -> dict[str, Callable[[int], Any]]:
    """What is called as often as its argument says."""
    run, c, world, bore, guard, _, watch, hooks = simulation.arguments
    of = Repeated(n)
    return {
        "model": lambda times: of.models(times, c),
        "port": lambda times: of.ports(times, c),
        "resolver": lambda times: of.resolvers(times, c),
        "law": (lambda times: of.laws(times, c)) if uses_torque else lambda times: None,
        "task": lambda times: of.commands(times, run, c, world),
        "safety": lambda times: of.checks(times, guard, watch, world, c.command),
        "period": lambda times: of.periods(times, run, world, bore, hooks),
        "clock": lambda times: of.clocks(times),
    }
