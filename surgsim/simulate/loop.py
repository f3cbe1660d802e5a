"""The control loop: controller and plant, tick by tick, into a trace."""

import math
from collections.abc import Callable
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from surgsim.compiled import compiled
from surgsim.control.controller import ControlOutput
from surgsim.control.manipulability import manipulability_series
from surgsim.control.problem import ControlFailure
from surgsim.errors import Outcome
from surgsim.plant.state import State
from surgsim.plant.truth import Truth
from surgsim.scenario.schema import Scenario
from surgsim.simulate.safety import SafetyMonitor
from surgsim.simulate.setup import Setup, prepare
from surgsim.tasks.base import TipCommand
from surgsim.trace.trace import BASE_BLOCKS, Block, Ending, Trace, TraceMeta, joints

Array = NDArray[np.float64]
Progress = Callable[[float, float], None]
"""Called now and then with the simulated time reached and the whole duration [s]."""

_PROGRESS_TICKS = 250


def simulate(scenario: Scenario, progress: Progress | None = None) -> Trace:
    """Run a scenario to its end, or to the outcome that stops it.

    Raises:
        SurgsimError: If it cannot be started, e.g. because the path is out of reach.
    """
    return Simulation(prepare(scenario)).run(progress)


class Simulation:
    """One run of a prepared scenario, stepped by `tick` or to its end by `run`.

    Every row of the trace holds the state at a tick, the command for it, and the torque commanded from it.
    """

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        scenario = setup.scenario
        self._period = scenario.simulation.control_period_s
        self._ticks = math.ceil(setup.task.duration_s / self._period - 1e-6)
        self._torque_limit = setup.scene.limits.torque
        self._safety = SafetyMonitor(scenario.safety, setup.scene.limits, scenario.trocar is not None)
        terms = tuple(joints(f"tau_{term}_", "nm") for term in setup.controller.terms)
        self._rows = _Rows((*BASE_BLOCKS, *terms), self._ticks + 1)
        self._uses_torque = scenario.plant.uses_torque
        self._state: State = setup.plant.reset(setup.q_start)
        setup.controller.reset()
        self._count = 0
        self._ending: Ending | None = None

    @property
    def time_s(self) -> float:
        """Simulated time reached [s]."""
        return self._count * self._period

    @property
    def ended(self) -> bool:
        """Whether the run has ended."""
        return self._ending is not None

    @property
    def ending(self) -> Ending | None:
        """How the run ended; None while it goes on."""
        return self._ending

    @property
    def state(self) -> State:
        """The plant's state at the present tick."""
        return self._state

    @property
    def due(self) -> bool:
        """Whether the next tick ends the run whatever the controller does: time is up, or a limit passed."""
        if self._count >= self._ticks:
            return True
        command, truth = self._setup.task.command(self._state.t_s), self._setup.plant.truth()
        return self._safety.check(self._state, truth, command) is not None

    def run(self, progress: Progress | None = None) -> Trace:
        """Tick to the end."""
        duration = self._setup.task.duration_s
        while not self.ended:
            self.tick()
            if progress is not None and self._count % _PROGRESS_TICKS == 0:
                progress(self.time_s, duration)
        return self.trace()

    def tick(self) -> None:
        """One control period: look, decide, record, act. Does nothing once ended."""
        if self.ended:
            return
        setup, state = self._setup, self._state
        command = setup.task.command(state.t_s)
        truth = setup.plant.truth()
        self._ending = self._safety.check(state, truth, command)
        if self.ended:
            self._rows.add(state, truth, command)
            return
        began = perf_counter()
        try:
            output = setup.controller.tick(state, command)
        except ControlFailure as failure:
            self._ending = Ending(
                outcome=failure.outcome, t_s=state.t_s, detail=failure.detail, data=failure.data
            )
            self._rows.add(state, truth, command)
            return
        took = perf_counter() - began
        self._record(state, truth, command, output, took)
        if not math.isfinite(output.torque @ output.torque):
            self._ending = Ending(outcome=Outcome.DIVERGED, t_s=state.t_s, detail="torque is not finite")
            return
        if self._count >= self._ticks:
            self._ending = Ending(outcome=Outcome.COMPLETED, t_s=state.t_s)
            return
        self._state = setup.plant.step(output.torque, output.resolution.qdot)
        self._count += 1

    def trace(self) -> Trace:
        """The trace so far, with its derived columns."""
        ending = self._ending or Ending(outcome=Outcome.COMPLETED, t_s=self.time_s)
        limits = self._setup.scene.limits
        meta = TraceMeta(
            scenario=self._setup.scenario.resolved(),
            control_period_s=self._period,
            limits={
                name: getattr(limits, name).tolist()
                for name in ("q_min", "q_max", "velocity", "acceleration", "torque")
            },
            ending=ending,
        )
        return self._rows.finish(meta, self._setup)

    def _record(
        self, state: State, truth: Truth, command: TipCommand, output: ControlOutput, took: float
    ) -> None:
        row = self._rows.add(state, truth, command)
        at = self._rows.at
        row[at["qdot_ref"]] = output.resolution.qdot
        row[at["q_ref"]] = output.q_ref
        row[at["resolver_residual"]] = output.resolution.residual
        row[at["control_time"]] = took
        if self._uses_torque:
            inside, count = _saturate(output.torque, self._torque_limit)
            row[at["tau"]] = inside
            row[at["saturated_joints"]] = count
            row[self._rows.terms] = output.terms.ravel()


@compiled
def _saturate(torque: Array, limit: Array) -> tuple[Array, int]:
    """`torque` cut at `limit`, and how many joints were cut."""
    inside, count = np.empty(7), 0
    for i in range(7):
        inside[i] = min(max(torque[i], -limit[i]), limit[i])
        count += inside[i] != torque[i]
    return inside, count


class _Rows:
    """Preallocated rows of the trace; what is never written stays NaN."""

    def __init__(self, blocks: tuple[Block, ...], rows: int) -> None:
        self._blocks = blocks
        self.at: dict[str, slice] = {}
        width = 0
        for block in blocks:
            self.at[block.name] = slice(width, width + len(block.columns))
            width += len(block.columns)
        base = self.at[BASE_BLOCKS[-1].name].stop
        self.terms = slice(base, width)
        self._data = np.full((rows, width), np.nan)
        self._count = 0

    def add(self, state: State, truth: Truth, command: TipCommand) -> Array:
        """Begin the next row with what is known of every tick, also of one that ends the run."""
        at = self.at
        row: Array = self._data[self._count]
        self._count += 1
        row[at["t"]] = state.t_s
        row[at["q"]] = state.q
        row[at["v"]] = state.v
        row[at["tip"]] = truth.p_WT
        row[at["tip_ref"]] = command.p_WTd
        row[at["wrist"]] = truth.p_WR
        row[at["trocar"]] = truth.p_WC
        return row

    def finish(self, meta: TraceMeta, setup: Setup) -> Trace:
        """The rows written so far with the derived columns, as a trace."""
        data, at = self._data[: self._count].copy(), self.at
        tip, wrist, trocar = data[:, at["tip"]], data[:, at["wrist"]], data[:, at["trocar"]]
        data[:, at["tip_error"]] = np.linalg.norm(tip - data[:, at["tip_ref"]], axis=1, keepdims=True)
        axis = (tip - wrist) / np.linalg.norm(tip - wrist, axis=1, keepdims=True)
        data[:, at["rcm_error"]] = np.linalg.norm(np.cross(trocar - tip, axis), axis=1, keepdims=True)
        translational, whole = manipulability_series(setup.arm, data[:, at["q"]])
        data[:, at["manipulability"]] = translational[:, None]
        data[:, at["manipulability_6d"]] = whole[:, None]
        data.flags.writeable = False
        return Trace(data, self._blocks, meta)
