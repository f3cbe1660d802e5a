"""What a simulation needs of a run, of one arm or of several."""

from typing import Protocol

import mujoco

from surgsim.array import Array
from surgsim.scenario.arms import Experiment
from surgsim.simulate.arm_run import ArmRun
from surgsim.tick.arrays import Record
from surgsim.trace.trace import Ending, Trace


class Way(Protocol):
    """Arms on their way, tick by tick.

    Attributes:
        stop_ticks: Ticks for which the arms are held after an outcome.
    """

    stop_ticks: int

    @property
    def arms(self) -> tuple[ArmRun, ...]:
        """The arms' records; all are at the same tick."""
        ...

    @property
    def scenario(self) -> Experiment:
        """The scenario."""
        ...

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo's data."""
        ...

    @property
    def due(self) -> bool:
        """Whether the next tick ends the run whatever the controllers do: time is up, or a limit passed."""
        ...

    def begin(self) -> None:
        """Put everything at its start, and ask the tasks for their first commands."""
        ...

    def go(self, ticks: int) -> Ending | None:
        """Run up to `ticks` ticks, no more than the parts have drawn for; how the run ended, if it did."""
        ...

    def hold(self, ticks: int) -> tuple[int, bool]:
        """Up to `ticks` ticks of the stop: how many, and whether it goes on."""
        ...

    def records(self) -> dict[str, tuple[Record, type[Record]]]:
        """The records by name, with their kinds."""
        ...

    def arrays(self) -> dict[str, Array]:
        """Arrays that change over the run, by name."""
        ...

    def objects(self) -> dict[str, object]:
        """What is a Python object with a state, by name."""
        ...

    def shared(self) -> dict[str, object]:
        """What belongs to this simulation, and stands by its name in a snapshot."""
        ...

    def trace(self, ending: Ending, first: int = 0) -> Trace:
        """The rows from `first` on, with the derived columns."""
        ...
