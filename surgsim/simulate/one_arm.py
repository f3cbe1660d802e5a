"""A run of one arm, as `Simulation` drives it."""

import mujoco

from surgsim.array import Array
from surgsim.compiled import as_parameter
from surgsim.scenario.schema import Scenario
from surgsim.simulate.arm_run import REFLEXES, ArmRun, stop_ticks_of, ticks_of
from surgsim.simulate.setup import Setup
from surgsim.simulate.ticks import (
    GOING,
    PLANT_TOLD,
    TASK_TOLD,
    ask_signature,
    ask_task,
    hold_signature,
    hold_ticks,
    run_signature,
    run_ticks,
)
from surgsim.tick.arrays import Record
from surgsim.tick.status import GOES_ON
from surgsim.trace.trace import Ending, Trace


class OneArm:
    """One arm on its way; the attributes are those of `surgsim.simulate.way.Way`.

    Args:
        setup: Its parts.
    """

    def __init__(self, setup: Setup) -> None:
        self._setup, n = setup, setup.arm.limits.q_min.size
        self.stop_ticks = stop_ticks_of(setup) if setup.scenario.plant.uses_torque else 0
        self._arm = ArmRun(setup, ticks_of(setup) + 1 + stop_ticks_of(setup))
        self.arms = (self._arm,)
        self._run_ticks = as_parameter(run_ticks, run_signature(n))
        self._hold_ticks = as_parameter(hold_ticks, hold_signature(n))
        self._ask_task = as_parameter(ask_task, ask_signature(n))

    @property
    def scenario(self) -> Scenario:
        """The scenario."""
        return self._setup.scenario

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo's data."""
        return self._setup.plant.data

    @property
    def due(self) -> bool:
        """Whether the next tick ends the run whatever the controller does."""
        return self._arm.over or not self._arm.safe

    def begin(self) -> None:
        """Put everything at its start, and ask the task for its first command."""
        setup = self._setup
        setup.plant.reset(setup.q_start)
        setup.controller.reset()
        setup.task.reset()
        run, c, world, *_ = self._arm.arguments
        status = self._ask_task(run, c, world)
        if status != GOES_ON:
            self._arm.ending(TASK_TOLD, int(status))

    def go(self, ticks: int) -> Ending | None:
        """Run up to `ticks` ticks; how the run ended, if it did."""
        self._arm.refill(ticks)
        self._run_ticks(ticks, *self._arm.arguments)
        progress = self._arm.run.progress
        if progress.reason == GOING:
            return None
        return self._arm.ending(int(progress.reason), int(progress.status))

    def hold(self, ticks: int) -> tuple[int, bool]:
        """Up to `ticks` ticks of the stop: how many, and whether it goes on."""
        run, c, world, bore, _, stop, _, hooks = self._arm.arguments
        self._setup.plant.refill()
        done = int(self._hold_ticks(ticks, run, c, world, bore, stop, hooks))
        if run.progress.reason == PLANT_TOLD:
            run.progress.reason = GOING
            told = self._arm.ending(PLANT_TOLD, int(run.progress.status))
            return done, told.outcome in REFLEXES  # told once; the stop goes on
        return done, done == ticks

    def records(self) -> dict[str, tuple[Record, type[Record]]]:
        """Its records by name, with their kinds."""
        return self._arm.records()

    def arrays(self) -> dict[str, Array]:
        """Arrays that change over the run, by name."""
        return self._arm.arrays()

    def objects(self) -> dict[str, object]:
        """What is a Python object with a state, by name."""
        return self._arm.objects()

    def shared(self) -> dict[str, object]:
        """What belongs to this simulation, and stands by its name in a snapshot."""
        return self._arm.shared()

    def trace(self, ending: Ending, first: int = 0) -> Trace:
        """The rows from `first` on, with the derived columns."""
        return self._arm.trace(ending, first)
