"""The simulation at the pace of the wall clock, with a person in the loop."""

import signal
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

import numpy as np

from surgsim.array import Array
from surgsim.live.controls import Controls
from surgsim.live.pace import Pace
from surgsim.live.status import Status, status
from surgsim.plant.truth import Truth
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import Setup
from surgsim.tasks.teleoperation import Teleoperation
from surgsim.trace.trace import Trace

_FRAME_S = 1.0 / 60.0


class Screen(Protocol):
    """What the operator looks at."""

    @property
    def is_open(self) -> bool:
        """Whether it is still there."""
        ...

    def axes(self) -> Array:
        """Its right, away and up in the world, as columns (3, 3)."""
        ...

    def show(self, truth: Truth, status: Status) -> None:
        """Show this soon."""
        ...


def drive(
    setup: Setup, simulation: Simulation, controls: Controls, screen: Screen, pace: Pace, help: str
) -> Trace:
    """Run until the task ends, a limit is passed or the operator is done; what follows is not shown.

    The screen shows what the channel has delivered, not what is.
    """
    late = LatePicture(setup)
    period = setup.scenario.simulation.control_period_s
    ticks = max(1, round(_FRAME_S / period))
    while not (simulation.ended or controls.intent.end):
        controls.poll(simulation.time_s, screen.axes())
        if not screen.is_open:
            controls.end()
        late.remember(simulation.rows)
        for _ in range(ticks):
            simulation.tick()
        seen = status(
            t_s=simulation.time_s,
            duration_s=setup.task.duration_s,
            factor=pace.factor,
            speed_m_per_s=controls.speed_m_per_s,
            jaw=controls.intent.jaw,
            clutch=controls.intent.clutch,
            force_n=_force_on_hand(setup),
            help=help,
        )
        screen.show(late.delivered(), seen)
        pace.wait(simulation.time_s)
    return simulation.run()


class LatePicture:
    """The states that are under way to the operator's screen, and the one that has arrived.

    A picture is taken once a frame and travels with the packet of its tick: what is shown at t is a state of
    t less the channel's delay, at most a frame older. Packets that are lost or late leave the picture as it
    was.

    Args:
        setup: Of a teleoperation; another task has no channel, and is shown as it is.
    """

    def __init__(self, setup: Setup) -> None:
        self._plant = setup.plant
        self._task = setup.task if isinstance(setup.task, Teleoperation) else None
        self._shown = setup.plant.truth()
        self._waiting: deque[tuple[int, Truth]] = deque()

    def remember(self, tick: int) -> None:
        """Keep the state of now, of the tick that comes; to be called before it."""
        if self._task is not None:
            self._waiting.append((tick, self._plant.truth()))

    def delivered(self) -> Truth:
        """The newest state that has arrived; at first the start."""
        if self._task is None:
            return self._plant.truth()
        while self._waiting and self._waiting[0][0] <= self._task.picture_tick:
            self._shown = self._waiting.popleft()[1]
        return self._shown


def _force_on_hand(setup: Setup) -> float:
    """Size of the force that the console renders [N]."""
    first = 0
    for block in setup.task.columns:
        if block.name == "master_force":
            return float(np.linalg.norm(setup.task.values()[first : first + 3]))
        first += len(block.columns)
    return 0.0


@contextmanager
def signals_end(controls: Controls) -> Iterator[None]:
    """Ctrl-C and a request to terminate end the operator's work; nothing that was done is lost."""
    kinds = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(kind, lambda *_: controls.end()) for kind in kinds]
    try:
        yield
    finally:
        for kind, handler in zip(kinds, before, strict=True):
            signal.signal(kind, handler)
