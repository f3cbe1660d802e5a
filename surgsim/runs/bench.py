"""The project's own speed figures: what a tick costs, in physics steps of the same model.

Ticks and bare `mj_step` are measured in turn, chunk by chunk, in thread time, and the median of
the chunks' ratios counts: what else the machine does slows both alike.
"""

import statistics
import time
from collections.abc import Callable
from typing import Any

import mujoco

from surgsim.errors import SurgsimError
from surgsim.scenario.load import load_scenario, shipped
from surgsim.scenario.schema import Scenario
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import prepare

_SCENARIO = "circle_lwr4plus"
_CHUNK = 256
MOST_S = 3600.0
_NEEDS = {"rcm_interaction_force": ("trocar.wall={}",)}
"""What a controller needs in the scenario to be run at all."""
OTHERS = ("theatre_lwr4plus", "teleop_free_motion_panda")
"""Scenarios that are measured with their own controller."""


def bench(duration_s: float, repeat: int) -> list[dict[str, Any]]:
    """A row for the circle with every shipped controller, and for each of `OTHERS`.

    Args:
        duration_s: Simulated time of a run [s].
        repeat: Runs of each; the chunks of all count.

    Raises:
        SurgsimError: If the duration is not from 1 s to an hour, or the count is not positive.
    """
    if not (1.0 <= duration_s <= MOST_S and repeat >= 1):
        raise SurgsimError(
            f"bench needs a duration of at least 1 s and at most {MOST_S:g} s, and at least one repeat"
        )
    rows = [_row(f"circle, {name}", _circle(name), duration_s, repeat) for name in shipped("controllers")]
    return [*rows, *(_row(name, load_scenario(name), duration_s, repeat) for name in OTHERS)]


def _circle(controller: str) -> Scenario:
    return load_scenario(_SCENARIO, controller=controller, assignments=_NEEDS.get(controller, ()))


def _row(name: str, scenario: Scenario, duration_s: float, repeat: int) -> dict[str, Any]:
    """Ticks against bare steps."""
    began = time.thread_time()
    setup = prepare(scenario)
    Simulation(setup).advance(1)
    start_s = time.thread_time() - began
    chunks = [chunk for _ in range(repeat) for chunk in _chunks(scenario, duration_s)]
    period = scenario.simulation.control_period_s
    tick_s = statistics.median(tick for tick, _ in chunks)
    return {
        "run": name,
        "ratio": statistics.median(tick / step for tick, step in chunks),
        "tick_us": 1e6 * tick_s,
        "mj_step_us": 1e6 * statistics.median(step for _, step in chunks),
        "real_time_factor": period / tick_s,
        "start_up_s": start_s,
    }


def _chunks(scenario: Scenario, duration_s: float) -> list[tuple[float, float]]:
    """Thread time of a tick, and of the bare steps of its period, chunk by chunk [s]; the first warms up."""
    setup = prepare(scenario)
    simulation, model = Simulation(setup), setup.scene.model
    data = mujoco.MjData(model)
    data.qpos[setup.scene.qpos_ids] = setup.q_start
    period = scenario.simulation.control_period_s
    substeps = round(period / model.opt.timestep)
    measured: list[tuple[float, float]] = []
    while not simulation.ended and simulation.time_s + _CHUNK * period <= duration_s:
        tick = _time(lambda: simulation.advance(_CHUNK))
        if simulation.ended:
            break
        step = _time(lambda: mujoco.mj_step(model, data, nstep=_CHUNK * substeps))
        data.qpos[setup.scene.qpos_ids], data.qvel[:] = simulation.state.q, 0.0
        measured.append((tick / _CHUNK, step / _CHUNK))
    if len(measured) < 2:
        raise SurgsimError(f"{scenario.name}: the run ended before two chunks of {_CHUNK} ticks")
    return measured[1:]


def _time(call: Callable[[], None]) -> float:
    began = time.thread_time()
    call()
    return time.thread_time() - began
