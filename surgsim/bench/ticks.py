"""What a tick costs beside a bare `mj_step` of the same model."""

from typing import Any

import mujoco
import numpy as np

from surgsim.bench.cases import Case
from surgsim.bench.chunks import CHUNK, thread_time_of
from surgsim.errors import SurgsimError
from surgsim.simulate.arms_setup import ArmsSetup
from surgsim.simulate.loop import Simulation, prepared
from surgsim.simulate.setup import Setup

Row = dict[str, Any]


class BareSteps:
    """Plain `mj_step` of a run's model from the run's present state, its torques held.

    Args:
        setup: The run's parts.
        ticks: Control periods of a call.
    """

    def __init__(self, setup: Setup | ArmsSetup, ticks: int) -> None:
        self._model, self._run = setup.model, setup.data
        self._data = mujoco.MjData(self._model)
        period = setup.scenario.simulation.control_period_s
        self._steps = ticks * round(period / self._model.opt.timestep)

    def follow(self) -> None:
        """Take over the run's state and torques."""
        mujoco.mj_copyData(self._data, self._model, self._run)

    def __call__(self) -> None:
        """Step."""
        mujoco.mj_step(self._model, self._data, nstep=self._steps)


def measure_ticks(case: Case, duration_s: float, repeat: int) -> Row:
    """A case's row.

    Args:
        case: What is run.
        duration_s: Simulated time of a run [s].
        repeat: Runs; the chunks of all count.

    Raises:
        SurgsimError: If the run ends before two chunks of ticks.
    """
    scenario = case.experiment()
    chunks = np.concatenate([_chunks(case, duration_s) for _ in range(repeat)])
    tick_s, step_s = np.median(chunks, axis=0)
    return {
        "case": case.name,
        "ratio": float(np.median(chunks[:, 0] / chunks[:, 1])),
        "tick_us": 1e6 * float(tick_s),
        "mj_step_us": 1e6 * float(step_s),
        "real_time_factor": scenario.simulation.control_period_s / float(tick_s),
    }


def _chunks(case: Case, duration_s: float) -> Any:
    """Time of a tick, and of the bare steps of its period, chunk by chunk (k, 2) [s]; the first warms up."""
    setup = prepared(case.experiment())
    simulation, steps = Simulation(setup), BareSteps(setup, CHUNK)
    period = setup.scenario.simulation.control_period_s
    measured: list[tuple[float, float]] = []
    while simulation.time_s + CHUNK * period <= duration_s:
        steps.follow()
        tick = thread_time_of(lambda: simulation.advance(CHUNK))
        if simulation.ended:
            break
        measured.append((tick / CHUNK, thread_time_of(steps) / CHUNK))
    if len(measured) < 2:
        raise SurgsimError(f"{case.name}: the run ended before two chunks of {CHUNK} ticks")
    return np.array(measured[1:])
