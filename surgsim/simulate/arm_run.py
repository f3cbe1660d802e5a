"""One arm's part of a run: its records, its rows, why it ends; the loop is another's."""

import math
from collections.abc import Callable

from surgsim.array import Array
from surgsim.columns import joints, width
from surgsim.errors import Outcome, SurgsimError
from surgsim.plant.bore import Bore
from surgsim.plant.contacts import Watch
from surgsim.plant.world import Hooks
from surgsim.scenario.schema import StopConfig
from surgsim.simulate.rows import Rows
from surgsim.simulate.safety import Guard, SafetyMonitor, is_safe
from surgsim.simulate.setup import Setup
from surgsim.simulate.stop import Stop, new_stop
from surgsim.simulate.ticks import DONE, FAILED, NOT_FINITE, TASK_TOLD, UNSAFE, Run
from surgsim.tasks.base import Looks, TipCommand
from surgsim.tasks.binding import BoundTask
from surgsim.tasks.command import command_of
from surgsim.tick.arrays import OUT_OF_TIME, Control, Record, World, new, point
from surgsim.tick.status import JOINT_ACCELERATION, JOINT_JERK, PACKETS_LOST, TORQUE_RATE
from surgsim.trace.trace import Ending, Trace, TraceMeta, base_blocks

Progress = Callable[[float, float], None]
"""Called now and then with the simulated time reached and the whole duration [s]."""

_CLOCK_EVERY = 8
_NO_STOP = StopConfig(duration_s=0.0)
_REFLEXES = {
    TORQUE_RATE: (Outcome.TORQUE_RATE_LIMIT, "asks for more than robot.drive's torque_rate_nm_per_s"),
    JOINT_ACCELERATION: (
        Outcome.ACCELERATION_DISCONTINUITY,
        "asks for more than robot.drive's joint_acceleration_rad_per_s2",
    ),
    JOINT_JERK: (
        Outcome.ACCELERATION_DISCONTINUITY,
        "asks for more than robot.drive's joint_jerk_rad_per_s3",
    ),
    PACKETS_LOST: (
        Outcome.COMMUNICATION_CONSTRAINTS_VIOLATION,
        "is the last of as many lost in a row as late_ticks' stop_after_ticks",
    ),
}
"""What a status of the plant is to a run, and the words for it."""
REFLEXES = frozenset(outcome for outcome, _ in _REFLEXES.values())
"""Outcomes by which the arm's interface ends a run; told once, and the stop goes on."""


def ticks_of(setup: Setup) -> int:
    """The last tick of a task."""
    return math.ceil(setup.task.duration_s / setup.scenario.simulation.control_period_s - 1e-6)


def stop_ticks_of(setup: Setup) -> int:
    """Ticks for which the arm is held after an outcome."""
    stop = setup.scenario.safety.stop or _NO_STOP
    return round(stop.duration_s / setup.scenario.simulation.control_period_s)


class ArmRun:
    """The records of one arm on its way, and what its trace is made of.

    Args:
        setup: The arm's parts.
        most_rows: Most rows that can be written.

    Attributes:
        setup: The arm's parts.
        run: Where its run is.
        safety: Its limits.
        task: Its task, as the loop sees it.
        stop: How it is stopped.
        rows: Its rows.
    """

    def __init__(self, setup: Setup, most_rows: int) -> None:
        self.setup = setup
        scenario, wall = setup.scenario, setup.scene.wall
        tear = math.inf if wall is None else wall.tear_force_n
        self.safety = SafetyMonitor(scenario.safety, setup.scene.limits, scenario.trocar is not None, tear)
        groups = {
            "terms": tuple(
                joints(f"tau_{term}_", "nm", setup.arm.limits.q_min.size) for term in setup.controller.terms
            ),
            "task": setup.task.columns,
            "controller": setup.controller.columns,
            "plant": setup.plant.columns,
        }
        self.rows = Rows(base_blocks(setup.arm.limits.q_min.size), groups, most_rows, setup.arm)
        self.task = BoundTask(setup.task, setup.controller.control.command)
        self.stop = new_stop(scenario.safety.stop or StopConfig(), setup.arm)
        self.run = self._wire()

    def _wire(self) -> Run:
        """The record of the run."""
        setup, scenario = self.setup, self.setup.scenario
        run = new(Run, 0)
        p, controller = run.progress, setup.controller
        p.last, p.most_infeasible = ticks_of(setup), scenario.safety.infeasible_ticks_max
        p.reacts, p.uses_torque = setup.task.reacts, scenario.plant.uses_torque
        p.shares_port, p.task_values = controller.estimates, width(setup.task.columns)
        p.resolver_values = width(controller.columns) - 3 * controller.estimates
        p.clock_every = _CLOCK_EVERY if controller.is_compiled else 1
        self.task.told = run.feedback
        self._show(run)
        for name in run.at.dtype.names or ():
            run.at[name] = self.rows.begins(name)[0]
        run.rows, run.columns = self.rows.data.ctypes.data, self.rows.data.shape[1]
        run.task, run.advance = self.task.kernel, setup.plant.advance
        point(run.task_gains, self.task.gains)
        point(run.task_memory, self.task.memory)
        return run

    def _show(self, run: Run) -> None:
        """Let a task that looks at things see the plant's columns."""
        setup, first = self.setup, 0
        point(run.feedback.plant, setup.plant.hooks.values)
        if isinstance(setup.task, Looks):
            places = {}
            for block in setup.plant.columns:
                places[block.name], first = first, first + len(block.columns)
            setup.task.look_at(places)

    @property
    def arguments(self) -> tuple[Run, Control, World, Bore, Guard, Stop, Watch, Hooks]:
        """What the loop works on: the arguments of `run_ticks` after the number of ticks."""
        plant, controller = self.setup.plant, self.setup.controller
        return (
            self.run,
            controller.control,
            plant.world,
            plant.bore,
            self.safety.guard,
            self.stop,
            plant.watch.record,
            plant.hooks.record,
        )

    @property
    def time_s(self) -> float:
        """Simulated time reached [s]."""
        return float(self.setup.plant.world.t_s)

    @property
    def count(self) -> int:
        """Rows so far."""
        return int(self.run.progress.rows)

    @property
    def command(self) -> TipCommand:
        """The task's command at the present tick."""
        return command_of(self.setup.controller.control.command)

    @property
    def over(self) -> bool:
        """Whether its task is done at the present tick."""
        tick, command = self.setup.plant.world.tick, self.setup.controller.control.command
        return bool(tick >= self.run.progress.last or command.finished)

    @property
    def safe(self) -> bool:
        """Whether none of its limits is passed."""
        plant, command = self.setup.plant, self.setup.controller.control.command
        return is_safe(self.safety.guard, plant.watch.record, plant.world, command)

    def refill(self, ticks: int) -> None:
        """Let its parts draw what the next `ticks` ticks need."""
        self.setup.plant.refill()
        self.task.refill(ticks)

    def ending(self, reason: int, status: int) -> Ending:
        """How the run ended by this arm; what a part in Python raised is raised here."""
        t_s = self.time_s
        if reason == UNSAFE:
            ending = self.safety.check(t_s, self.setup.plant.truth(), self.command)
            assert ending is not None, "a limit was passed, and none was found"
            return ending
        if reason == FAILED:
            failure = self.setup.controller.failure(int(self.run.progress.status))
            return Ending(outcome=failure.outcome, t_s=t_s, detail=failure.detail, data=failure.data)
        if reason == NOT_FINITE:
            return Ending(outcome=Outcome.DIVERGED, t_s=t_s, detail="torque is not finite")
        if reason == DONE:
            return self.done_at(t_s)
        if reason == TASK_TOLD:
            raise self.task.raised() or _stopped(self.setup.scenario.task.type, status)
        if status in _REFLEXES:
            outcome, said = _REFLEXES[status]
            return Ending(outcome=outcome, t_s=t_s, detail=f"the command at {t_s:.3f} s {said}")
        raise self.setup.plant.hooks.raised() or _stopped("a disturbance or prop", status)

    @property
    def out_of_time(self) -> bool:
        """Whether the task's time limit has passed before it was done."""
        return bool(self.setup.controller.control.command.finished == OUT_OF_TIME)

    def done_at(self, t_s: float) -> Ending:
        """How the run ended that came to its end at `t_s` [s]: completed, or out of time."""
        if not self.out_of_time:
            return Ending(outcome=Outcome.COMPLETED, t_s=t_s)
        detail = f"the task was not done after {t_s:g} s"
        return Ending(outcome=Outcome.TIME_LIMIT, t_s=t_s, detail=detail)

    def limits(self) -> dict[str, list[float]]:
        """Limits of the joints by name, for the trace."""
        drive, limits = self.setup.arm.drive, self.setup.scene.limits.published()
        if drive is not None and math.isfinite(drive.torque_rate):
            limits["torque_rate"] = [drive.torque_rate] * len(limits["torque"])
        return limits

    def trace(self, ending: Ending, first: int = 0) -> Trace:
        """The trace so far, or its rows from `first` on, with the derived columns."""
        meta = TraceMeta(
            scenario=self.setup.scenario.resolved(),
            control_period_s=self.setup.scenario.simulation.control_period_s,
            limits=self.limits(),
            ending=ending,
        )
        return self.rows.finish(self.count, meta, first)

    def records(self) -> dict[str, tuple[Record, type[Record]]]:
        """Its records by name, with their kinds."""
        plant, control = self.setup.plant, self.setup.controller.control
        return {
            "run": (self.run, Run),
            "control": (control, Control),
            "world": (plant.world, World),
            "bore": (plant.bore, Bore),
            "guard": (self.safety.guard, Guard),
            "stop": (self.stop, Stop),
        }

    def arrays(self) -> dict[str, Array]:
        """Numbers and memories of its parts, by name."""
        setup = self.setup
        return {"task_memory": self.task.memory, **setup.controller.arrays, **setup.plant.arrays}

    def objects(self) -> dict[str, object]:
        """What of it is a Python object with a state, by name."""
        setup = self.setup
        return {"task": setup.task, **setup.controller.objects, **setup.plant.objects}

    def shared(self) -> dict[str, object]:
        """What belongs to this simulation, and stands by its name in a snapshot."""
        setup = self.setup
        records = {name: record for name, (record, _) in self.records().items()}
        memory = {f"{name}'s memory": record.base for name, record in records.items()}
        return {
            **records,
            **memory,
            **self.arrays(),
            "task_gains": self.task.gains,
            "plant": setup.plant,
            "controller": setup.controller,
            "scene": setup.scene,
            "model": setup.scene.model,
            "data": setup.plant.data,
            "arm": setup.arm,
            "arm's scene": setup.arm.scene,
            "arm's model": setup.arm.scene.model,
        }


def _stopped(who: str, status: int) -> SurgsimError:
    """A part without an outcome of its own gave a status that does not go on."""
    return SurgsimError(f"{who} ended the run with status {status}")
