"""The control loop: controller and plant, tick by tick, into a trace."""

import math
from collections.abc import Callable
from copy import copy

import mujoco
import numpy as np
from numpy.typing import NDArray

from surgsim.columns import joints, width
from surgsim.compiled import as_parameter
from surgsim.errors import Outcome, SurgsimError
from surgsim.plant.bore import Bore
from surgsim.plant.contacts import Watch
from surgsim.plant.part import BLOCK_TICKS
from surgsim.plant.state import State
from surgsim.plant.world import Hooks
from surgsim.scenario.schema import Scenario, StopConfig
from surgsim.simulate.objects import put_back, store
from surgsim.simulate.rows import Rows
from surgsim.simulate.safety import Guard, SafetyMonitor, is_safe
from surgsim.simulate.setup import Setup, prepare
from surgsim.simulate.snapshot import Snapshot, content_of, fill
from surgsim.simulate.stop import Stop, new_stop
from surgsim.simulate.ticks import (
    DONE,
    FAILED,
    GOING,
    NOT_FINITE,
    PLANT_TOLD,
    TASK_TOLD,
    UNSAFE,
    Run,
    ask_signature,
    ask_task,
    hold_signature,
    hold_ticks,
    run_signature,
    run_ticks,
)
from surgsim.tasks.base import TipCommand
from surgsim.tasks.binding import BoundTask
from surgsim.tasks.command import command_of
from surgsim.tick.arrays import Control, Record, World, new, point
from surgsim.tick.status import GOES_ON, TORQUE_RATE
from surgsim.trace.trace import Ending, Trace, TraceMeta, base_blocks

Array = NDArray[np.float64]
Progress = Callable[[float, float], None]
"""Called now and then with the simulated time reached and the whole duration [s]."""

_CLOCK_EVERY = 8
_NO_STOP = StopConfig(duration_s=0.0)


def simulate(scenario: Scenario, progress: Progress | None = None) -> Trace:
    """Run a scenario to its end, or to the outcome that stops it.

    Raises:
        SurgsimError: If it cannot be started, e.g. because the path is out of reach.
    """
    setup = prepare(scenario)
    try:
        return Simulation(setup).run(progress)
    finally:
        setup.controller.close()


class Simulation:
    """One run of a prepared scenario, by `tick`, or by `run` to its end and the stop after it.

    The ticks themselves are the compiled function `run_ticks`; this builds its arrays and enters it for a few
    hundred ticks at a time. Every row of the trace holds the state at a tick, the command for it, and the
    torque commanded from it.
    """

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        scenario, plant = setup.scenario, setup.plant
        self._period = scenario.simulation.control_period_s
        wall = setup.scene.wall
        tear = math.inf if wall is None else wall.tear_force_n
        self._safety = SafetyMonitor(scenario.safety, setup.scene.limits, scenario.trocar is not None, tear)
        self._stop_ticks = round((scenario.safety.stop or _NO_STOP).duration_s / self._period)
        last = math.ceil(setup.task.duration_s / self._period - 1e-6)
        n = setup.arm.limits.q_min.size
        groups = {
            "terms": tuple(joints(f"tau_{term}_", "nm", n) for term in setup.controller.terms),
            "task": setup.task.columns,
            "controller": setup.controller.columns,
            "plant": plant.columns,
        }
        self._rows = Rows(base_blocks(n), groups, last + 1 + self._stop_ticks, setup.arm)
        self._task = BoundTask(setup.task, setup.controller.control.command)
        self._stop = new_stop(scenario.safety.stop or StopConfig(), setup.arm)
        self._run = self._wire(last)
        self._run_ticks = as_parameter(run_ticks, run_signature(n))
        self._hold_ticks = as_parameter(hold_ticks, hold_signature(n))
        self._ask_task = as_parameter(ask_task, ask_signature(n))
        self._ending: Ending | None = None
        plant.reset(setup.q_start)
        setup.controller.reset()
        setup.task.reset()
        self._ask()

    def _wire(self, last: int) -> Run:
        """The record of the run."""
        setup, scenario = self._setup, self._setup.scenario
        run = new(Run, 0)
        p, controller = run.progress, setup.controller
        p.last, p.most_infeasible = last, scenario.safety.infeasible_ticks_max
        p.reacts, p.uses_torque = setup.task.reacts, scenario.plant.uses_torque
        p.shares_port, p.task_values = controller.estimates, width(setup.task.columns)
        p.resolver_values = width(controller.columns) - 3 * controller.estimates
        p.clock_every = _CLOCK_EVERY if controller.is_compiled else 1
        self._task.told = run.feedback
        for name in run.at.dtype.names or ():
            run.at[name] = self._rows.begins(name)[0]
        run.rows, run.columns = self._rows.data.ctypes.data, self._rows.data.shape[1]
        run.task, run.advance = self._task.kernel, setup.plant.advance
        point(run.task_gains, self._task.gains)
        point(run.task_memory, self._task.memory)
        return run

    @property
    def arguments(self) -> tuple[Run, Control, World, Bore, Guard, Stop, Watch, Hooks]:
        """What the loop works on: the arguments of `run_ticks` after the number of ticks."""
        plant, controller = self._setup.plant, self._setup.controller
        return (
            self._run,
            controller.control,
            plant.world,
            plant.bore,
            self._safety.guard,
            self._stop,
            plant.watch.record,
            plant.hooks.record,
        )

    @property
    def time_s(self) -> float:
        """Simulated time reached [s]."""
        return float(self._setup.plant.world.t_s)

    @property
    def rows(self) -> int:
        """Rows of the trace so far."""
        return int(self._run.progress.rows)

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
        """The plant's state at the present tick, as it is measured."""
        return self._setup.plant.state()

    @property
    def command(self) -> TipCommand:
        """The task's command at the present tick."""
        return command_of(self._setup.controller.control.command)

    @property
    def due(self) -> bool:
        """Whether the next tick ends the run whatever the controller does: time is up, or a limit passed."""
        world, command = self._setup.plant.world, self._setup.controller.control.command
        over = world.tick >= self._run.progress.last or command.finished
        return bool(over) or not is_safe(self._safety.guard, self._setup.plant.watch.record, world, command)

    def run(self, progress: Progress | None = None) -> Trace:
        """Tick to the end; if that is an outcome that stops the arm, stop it and hold it for a while."""
        duration = self._setup.task.duration_s
        while not self.ended:
            self._advance_by(self._block(BLOCK_TICKS))
            if progress is not None:
                progress(self.time_s, duration)
        self._hold()
        return self.trace()

    def tick(self) -> None:
        """One control period: look, decide, record, act. Does nothing once ended."""
        if not self.ended:
            self._advance_by(1)

    def advance(self, ticks: int) -> None:
        """Up to `ticks` control periods, as `tick` would; fewer where the run ends."""
        left = ticks
        while left > 0 and not self.ended:
            block = self._block(left)
            self._advance_by(block)
            left -= block

    def _block(self, ticks: int) -> int:
        """How many of `ticks` come before parts draw again."""
        return min(ticks, BLOCK_TICKS - int(self._setup.plant.world.tick) % BLOCK_TICKS)

    def _advance_by(self, ticks: int) -> None:
        self._setup.plant.refill()
        self._task.refill(ticks)
        self._run_ticks(ticks, *self.arguments)
        if self._run.progress.reason != GOING:
            self._ending = self._end(int(self._run.progress.reason))

    def _end(self, reason: int) -> Ending:
        """How the run ended; what a part in Python raised is raised here."""
        t_s = self.time_s
        if reason == UNSAFE:
            ending = self._safety.check(t_s, self._setup.plant.truth(), self.command)
            assert ending is not None, "a limit was passed, and none was found"
            return ending
        if reason == FAILED:
            failure = self._setup.controller.failure(int(self._run.progress.status))
            return Ending(outcome=failure.outcome, t_s=t_s, detail=failure.detail, data=failure.data)
        if reason == NOT_FINITE:
            return Ending(outcome=Outcome.DIVERGED, t_s=t_s, detail="torque is not finite")
        if reason == DONE:
            return Ending(outcome=Outcome.COMPLETED, t_s=t_s)
        if reason == TASK_TOLD:
            raise self._task.raised() or self._stopped(self._setup.scenario.task.type)
        if int(self._run.progress.status) == TORQUE_RATE:
            detail = f"the command at {t_s:.3f} s asks for more than robot.drive's torque_rate_nm_per_s"
            return Ending(outcome=Outcome.TORQUE_RATE_LIMIT, t_s=t_s, detail=detail)
        raise self._setup.plant.hooks.raised() or self._stopped("a disturbance or prop")

    def _stopped(self, who: str) -> SurgsimError:
        """A part without an outcome of its own gave a status that does not go on."""
        return SurgsimError(f"{who} ended the run with status {int(self._run.progress.status)}")

    def _hold(self) -> None:
        """The stop after the outcome: rows without a command, for its time or until the state diverges."""
        if self._ending is None or self._ending.outcome is Outcome.COMPLETED:
            return
        if not self._run.progress.uses_torque:
            return
        left = self._stop_ticks
        while left > 0:
            ticks, plant = self._block(left), self._setup.plant
            plant.refill()
            done = self._hold_ticks(
                ticks,
                self._run,
                self._setup.controller.control,
                plant.world,
                plant.bore,
                self._stop,
                plant.hooks.record,
            )
            if self._run.progress.reason == PLANT_TOLD:
                self._run.progress.reason = GOING
                if self._end(PLANT_TOLD).outcome is Outcome.TORQUE_RATE_LIMIT:  # told once; the stop goes on
                    left -= done
                    continue
            if done < ticks:
                return
            left -= ticks

    def _ask(self) -> None:
        """The task's command for the present state."""
        c, world = self._setup.controller.control, self._setup.plant.world
        status = self._ask_task(self._run, c, world)
        if status != GOES_ON:
            self._run.progress.status = status
            self._end(TASK_TOLD)

    def snapshot(self) -> Snapshot:
        """All that the run is now.

        Raises:
            SurgsimError: If a part that is a Python object has a state that cannot be copied.
        """
        return Snapshot(
            scenario=self._setup.scenario.model_dump_json(),
            t_s=self.time_s,
            records={name: content_of(record) for name, (record, _) in self._records().items()},
            arrays={name: array.copy() for name, array in self._arrays().items()},
            rows=self._rows.data[: int(self._run.progress.rows)].copy(),
            data=copy(self._setup.plant.data),
            objects=store(self._objects(), self._shared()),
            ending=self._ending,
        )

    def restore(self, snapshot: Snapshot) -> None:
        """Be at the tick of `snapshot`: what follows has the same bits as what followed it.

        Raises:
            SurgsimError: If it is of another scenario.
        """
        if snapshot.scenario != self._setup.scenario.model_dump_json():
            raise SurgsimError(f"{self._setup.scenario.name}: the snapshot is of another scenario")
        for name, (record, kind) in self._records().items():
            fill(record, kind, snapshot.records[name])
        for name, array in self._arrays().items():
            array[...] = snapshot.arrays[name]
        rows = self._rows.data
        rows[: len(snapshot.rows)], rows[len(snapshot.rows) :] = snapshot.rows, math.nan
        mujoco.mj_copyData(self._setup.plant.data, self._setup.scene.model, snapshot.data)
        put_back(self._objects(), snapshot.objects, self._shared())
        self._ending = snapshot.ending

    def fork(self) -> "Simulation":
        """Another simulation at the same tick, which goes on by itself.

        Raises:
            SurgsimError: If a part that is a Python object has a state that cannot be copied.
        """
        other = Simulation(prepare(self._setup.scenario))
        other.restore(self.snapshot())
        return other

    def _records(self) -> dict[str, tuple[Record, type[Record]]]:
        plant, control = self._setup.plant, self._setup.controller.control
        return {
            "run": (self._run, Run),
            "control": (control, Control),
            "world": (plant.world, World),
            "bore": (plant.bore, Bore),
            "guard": (self._safety.guard, Guard),
            "stop": (self._stop, Stop),
        }

    def _arrays(self) -> dict[str, Array]:
        setup = self._setup
        return {"task_memory": self._task.memory, **setup.controller.arrays, **setup.plant.arrays}

    def _objects(self) -> dict[str, object]:
        setup = self._setup
        return {"task": setup.task, **setup.controller.objects, **setup.plant.objects}

    def _shared(self) -> dict[str, object]:
        """What belongs to this simulation, and stands by its name in a snapshot."""
        setup = self._setup
        records = {name: record for name, (record, _) in self._records().items()}
        memory = {f"{name}'s memory": record.base for name, record in records.items()}
        return {
            **records,
            **memory,
            **self._arrays(),
            "task_gains": self._task.gains,
            "plant": setup.plant,
            "controller": setup.controller,
            "scene": setup.scene,
            "model": setup.scene.model,
            "data": setup.plant.data,
            "arm": setup.arm,
            "arm's scene": setup.arm.scene,
            "arm's model": setup.arm.scene.model,
        }

    def trace(self, first: int = 0) -> Trace:
        """The trace so far, or its rows from `first` on, with the derived columns."""
        ending = self._ending or Ending(outcome=Outcome.COMPLETED, t_s=self.time_s)
        drive = self._setup.arm.drive
        limits = self._setup.scene.limits.published()
        if drive is not None and math.isfinite(drive.torque_rate):
            limits["torque_rate"] = [drive.torque_rate] * len(limits["torque"])
        meta = TraceMeta(
            scenario=self._setup.scenario.resolved(),
            control_period_s=self._period,
            limits=limits,
            ending=ending,
        )
        return self._rows.finish(int(self._run.progress.rows), meta, first)
