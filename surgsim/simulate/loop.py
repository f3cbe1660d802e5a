"""The control loop: controllers and plant, tick by tick, into a trace."""

from copy import copy

import mujoco

from surgsim.errors import Outcome, SurgsimError
from surgsim.plant.bore import Bore
from surgsim.plant.contacts import Watch
from surgsim.plant.part import BLOCK_TICKS
from surgsim.plant.state import State
from surgsim.plant.world import Hooks
from surgsim.scenario.arms import ArmsScenario, Experiment
from surgsim.simulate.arm_run import ArmRun
from surgsim.simulate.arm_run import Progress as Progress
from surgsim.simulate.arms_setup import ArmsSetup, prepare_arms
from surgsim.simulate.objects import put_back, store
from surgsim.simulate.one_arm import OneArm
from surgsim.simulate.safety import Guard
from surgsim.simulate.setup import Setup, prepare
from surgsim.simulate.several_arms import SeveralArms
from surgsim.simulate.snapshot import Snapshot, content_of, fill
from surgsim.simulate.stop import Stop
from surgsim.simulate.ticks import Run
from surgsim.simulate.way import Way
from surgsim.tasks.base import TipCommand
from surgsim.tick.arrays import Control, Record, World
from surgsim.trace.trace import Ending, Trace


def prepared(scenario: Experiment) -> Setup | ArmsSetup:
    """The built parts of a scenario, of one arm or of several.

    Raises:
        SurgsimError: As `surgsim.simulate.setup.prepare`.
    """
    return prepare_arms(scenario) if isinstance(scenario, ArmsScenario) else prepare(scenario)


def simulate(scenario: Experiment, progress: Progress | None = None) -> Trace:
    """Run a scenario to its end, or to the outcome that stops it.

    Raises:
        SurgsimError: If it cannot be started, e.g. because the path is out of reach.
    """
    setup = prepared(scenario)
    try:
        return Simulation(setup).run(progress)
    finally:
        setup.close()


class Simulation:
    """One run of a prepared scenario, by `tick`, or by `run` to its end and the stop after it.

    The ticks themselves are compiled functions, which are entered for a few hundred ticks at a time. Every
    row of the trace holds the state at a tick, the command for it, and the torque commanded from it.
    """

    def __init__(self, setup: Setup | ArmsSetup) -> None:
        self._setup = setup
        self._begin(SeveralArms(setup) if isinstance(setup, ArmsSetup) else OneArm(setup))

    def _begin(self, way: Way) -> None:
        self._way = way
        self._ending: Ending | None = None
        way.begin()

    @property
    def _only(self) -> ArmRun:
        """The arm of a run of one.

        Raises:
            SurgsimError: If there are several.
        """
        if len(self._way.arms) > 1:
            raise SurgsimError(f"{self._way.scenario.name}: a run of several arms has no single state")
        return self._way.arms[0]

    @property
    def arguments(self) -> tuple[Run, Control, World, Bore, Guard, Stop, Watch, Hooks]:
        """What the loop of one arm works on: the arguments of `run_ticks` after the number of ticks."""
        return self._only.arguments

    @property
    def time_s(self) -> float:
        """Simulated time reached [s]."""
        return self._way.arms[0].time_s

    @property
    def rows(self) -> int:
        """Rows of the trace so far."""
        return self._way.arms[0].count

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
        return self._only.setup.plant.state()

    @property
    def command(self) -> TipCommand:
        """The task's command at the present tick."""
        return self._only.command

    @property
    def due(self) -> bool:
        """Whether the next tick ends the run whatever the controller does: time is up, or a limit passed."""
        return self._way.due

    def run(self, progress: Progress | None = None) -> Trace:
        """Tick to the end; if that is an outcome that stops the arm, stop it and hold it for a while."""
        duration = self._setup.duration_s
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
        return min(ticks, BLOCK_TICKS - int(self._way.arms[0].setup.plant.world.tick) % BLOCK_TICKS)

    def _advance_by(self, ticks: int) -> None:
        self._ending = self._way.go(ticks)

    def _hold(self) -> None:
        """The stop after the outcome: rows without a command, for its time or until the state diverges."""
        if self._ending is None or self._ending.outcome is Outcome.COMPLETED:
            return
        left = self._way.stop_ticks
        while left > 0:
            done, goes_on = self._way.hold(self._block(left))
            if not goes_on:
                return
            left -= done

    def snapshot(self) -> Snapshot:
        """All that the run is now.

        Raises:
            SurgsimError: If a part that is a Python object has a state that cannot be copied.
        """
        way = self._way
        return Snapshot(
            scenario=way.scenario.model_dump_json(),
            t_s=self.time_s,
            records={name: content_of(record) for name, (record, _) in way.records().items()},
            arrays={name: array.copy() for name, array in way.arrays().items()},
            rows=tuple(arm.rows.data[: arm.count].copy() for arm in way.arms),
            data=copy(way.data),
            objects=store(way.objects(), way.shared()),
            ending=self._ending,
        )

    def restore(self, snapshot: Snapshot) -> None:
        """Be at the tick of `snapshot`: what follows has the same bits as what followed it.

        Raises:
            SurgsimError: If it is of another scenario.
        """
        way = self._way
        if snapshot.scenario != way.scenario.model_dump_json():
            raise SurgsimError(f"{way.scenario.name}: the snapshot is of another scenario")
        for name, (record, kind) in way.records().items():
            fill(record, kind, snapshot.records[name])
        for name, array in way.arrays().items():
            array[...] = snapshot.arrays[name]
        for arm, rows in zip(way.arms, snapshot.rows, strict=True):
            arm.rows.put_back(rows)
        mujoco.mj_copyData(way.data, way.arms[0].setup.scene.model, snapshot.data)
        put_back(way.objects(), snapshot.objects, way.shared())
        self._ending = snapshot.ending

    def fork(self) -> "Simulation":
        """Another simulation at the same tick, which goes on by itself.

        Raises:
            SurgsimError: If a part that is a Python object has a state that cannot be copied.
        """
        other = Simulation(prepared(self._way.scenario))
        other.restore(self.snapshot())
        return other

    def _records(self) -> dict[str, tuple[Record, type[Record]]]:
        return self._way.records()

    def trace(self, first: int = 0) -> Trace:
        """The trace so far, or its rows from `first` on, with the derived columns."""
        ending = self._ending or Ending(outcome=Outcome.COMPLETED, t_s=self.time_s)
        return self._way.trace(ending, first)
