"""A run of several arms in one patient, as `Simulation` drives it."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, TypeVar

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.columns import of_arm
from surgsim.compiled import address_of, as_parameter
from surgsim.errors import Outcome
from surgsim.plant.between import Between
from surgsim.plant.several import SeveralPlants, Shared
from surgsim.scenario.arms import ArmsScenario
from surgsim.simulate.arm_run import REFLEXES, ArmRun, stop_ticks_of, ticks_of
from surgsim.simulate.arms_setup import ArmsSetup
from surgsim.simulate.arms_ticks import (
    ENTRY,
    Arms,
    arm_tick,
    arm_tick_signature,
    arms_signature,
    ask_arms,
    ask_arms_signature,
    hold_arms,
    run_arms,
)
from surgsim.simulate.ticks import ARMS_TOUCH, DONE, GOING, PLANT_TOLD
from surgsim.tick.arrays import Record, new
from surgsim.tick.views import place_of
from surgsim.trace.trace import Ending, Trace, TraceMeta

T = TypeVar("T")


class SeveralArms:
    """Several arms on their way; the attributes are those of `surgsim.simulate.way.Way`.

    The run is done when every arm's task is; an arm that is done before holds the end of its path. The first
    outcome of any arm ends the run for all.

    Args:
        setup: Their parts.
    """

    def __init__(self, setup: ArmsSetup) -> None:
        self._setup = setup
        each = setup.arms
        held = [stop_ticks_of(arm) for arm in each.values() if arm.scenario.plant.uses_torque]
        self.stop_ticks = max(held, default=0)
        most = max(ticks_of(arm) for arm in each.values()) + 1 + self.stop_ticks
        self._by_name = {name: ArmRun(arm, most) for name, arm in each.items()}
        self.arms = tuple(self._by_name.values())
        self._plants, self._watch = SeveralPlants(setup.plants), setup.watch
        self._reasons = np.zeros(len(each), dtype=np.int64)
        self._table = np.array([_entry(arm) for arm in self.arms], dtype=np.int64)
        self._record = arms = new(Arms, 0)
        arms.table, arms.count = self._table.ctypes.data, len(each)
        arms.reasons = self._reasons.ctypes.data
        self._run, self._hold = (as_parameter(kernel, arms_signature()) for kernel in (run_arms, hold_arms))
        self._ask = as_parameter(ask_arms, ask_arms_signature())

    @property
    def scenario(self) -> ArmsScenario:
        """The scenario."""
        return self._setup.scenario

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo's data."""
        return self._setup.data

    @property
    def due(self) -> bool:
        """Whether the next tick ends the run whatever the controllers do: a limit of any, or all are done."""
        safe = all(arm.safe for arm in self.arms) and self._watch.look() is None
        return not safe or all(arm.over for arm in self.arms)

    def begin(self) -> None:
        """Put everything at its start, and ask the tasks for their first commands."""
        self._plants.reset([arm.q_start for arm in self._setup.arms.values()])
        for arm in self._setup.arms.values():
            arm.controller.reset()
            arm.task.reset()
        self._ask(self._record)
        if self._record.reason != GOING:
            self._ending()

    def go(self, ticks: int) -> Ending | None:
        """Run up to `ticks` ticks; how the run ended, if it did."""
        for arm in self.arms:
            arm.refill(ticks)
        self._run(ticks, self._record, self._plants.record, self._watch.record)
        return None if self._record.reason == GOING else self._ending()

    def _ending(self) -> Ending:
        """How the run ended, with the arm by which it did."""
        told, t_s = self._record, self.arms[0].time_s
        if told.reason == DONE:
            for name, arm in self._by_name.items():
                if arm.out_of_time:
                    return _by(name, arm.done_at(t_s))
            return Ending(outcome=Outcome.COMPLETED, t_s=t_s)
        if told.reason == ARMS_TOUCH:
            found = self._watch.look()
            assert found is not None, "arms touch, and nothing was found"
            return Ending(outcome=Outcome.ARM_COLLISION, t_s=t_s, detail=found)
        name, arm = list(self._by_name.items())[int(told.who)]
        ending = arm.ending(int(told.reason), int(told.status))
        return _by(name, ending)

    def hold(self, ticks: int) -> tuple[int, bool]:
        """Up to `ticks` ticks of the stop: how many, and whether it goes on."""
        for arm in self.arms:
            arm.setup.plant.refill()
        self._record.reason = GOING
        done = int(self._hold(ticks, self._record, self._plants.record, self._watch.record))
        if self._record.reason == PLANT_TOLD:
            return done, self._ending().outcome in REFLEXES  # told once; the stop goes on
        return done, done == ticks

    def records(self) -> dict[str, tuple[Record, type[Record]]]:
        """The records by name, with their kinds."""
        own: dict[str, tuple[Record, type[Record]]] = {
            "arms": (self._record, Arms),
            "shared": (self._plants.record, Shared),
            "between": (self._watch.record, Between),
        }
        return {**own, **self._each(lambda arm: arm.records())}

    def arrays(self) -> dict[str, Array]:
        """Arrays that change over the run, by name."""
        return {"looked at": self._watch.seen, **self._each(lambda arm: arm.arrays())}

    def objects(self) -> dict[str, object]:
        """What is a Python object with a state, by name."""
        return self._each(lambda arm: arm.objects())

    def shared(self) -> dict[str, object]:
        """What belongs to this simulation, and stands by its name in a snapshot."""
        return self._each(lambda arm: arm.shared())

    def _each(self, of: Callable[[ArmRun], Mapping[str, T]]) -> dict[str, T]:
        """What every arm has by name, with the arm's name before it."""
        return {
            f"{name}'s {key}": value for name, arm in self._by_name.items() for key, value in of(arm).items()
        }

    def trace(self, ending: Ending, first: int = 0) -> Trace:
        """The rows from `first` on, with the derived columns: one time, then each arm's columns."""
        each = {name: arm.trace(ending, first) for name, arm in self._by_name.items()}
        one = next(iter(each.values()))
        time, data, limits = one.blocks[0], [one.block("t")], dict[str, Any]()
        blocks = [time]
        for name, trace in each.items():
            blocks += [of_arm(name, block) for block in trace.blocks[1:]]
            data.append(trace.data[:, len(time.columns) :])
            limits.update({f"{name}_{key}": values for key, values in trace.meta.limits.items()})
        meta = TraceMeta(
            scenario=self.scenario.resolved(),
            control_period_s=one.meta.control_period_s,
            limits=limits,
            ending=ending,
        )
        whole = np.hstack(data)
        whole.flags.writeable = False
        return Trace(whole, blocks, meta)


def _entry(arm: ArmRun) -> list[int]:
    """A row of the table."""
    run, c, world, _, guard, stop, watch, hooks = arm.arguments
    kernel = address_of(arm_tick, arm_tick_signature(world.q.size))
    entry = [kernel, *(place_of(record) for record in (run, c, world, guard, stop, watch, hooks))]
    assert len(entry) == ENTRY
    return entry


def _by(name: str, ending: Ending) -> Ending:
    """How a run ended, with the arm by which it did."""
    return replace(ending, detail=f"arm {name}: {ending.detail}" if ending.detail else f"arm {name}")
