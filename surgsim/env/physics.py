"""surgsim's simulation as a `dm_control` physics."""

from dataclasses import dataclass

import numpy as np
from dm_control.rl import control
from numpy.typing import ArrayLike, NDArray

from surgsim.control.policies.registry import offering
from surgsim.env.actions import AGENT, Agent
from surgsim.env.rewards import errors
from surgsim.errors import SurgsimError
from surgsim.plant.state import State
from surgsim.scenario.schema import Scenario
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import Setup, prepare
from surgsim.simulate.snapshot import Snapshot
from surgsim.tasks.base import TipCommand
from surgsim.trace.trace import Ending, Trace

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class EpisodeState:
    """An episode at a tick: its scenario, seed included, and the run."""

    scenario: Scenario
    snapshot: Snapshot


class SurgsimPhysics(control.Physics):
    """Runs a scenario with an agent tick by tick; its timestep is the control period.

    The episode is a `Simulation` like any other: its plant is the only writer of MuJoCo's data, its safety
    monitor ends it, and it gives a trace.

    Args:
        scenario: A scenario with an agent, see `with_agent`.

    Raises:
        SurgsimError: If the scenario cannot be started.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._agent = Agent()
        self._setup = self._prepare()
        self._simulation = Simulation(self._setup)

    @property
    def setup(self) -> Setup:
        """The built parts of the episode."""
        return self._setup

    @property
    def state(self) -> State:
        """What a controller sees now."""
        return self._simulation.state

    @property
    def command(self) -> TipCommand:
        """What the task asks for now."""
        return self._simulation.command

    @property
    def ending(self) -> Ending | None:
        """How the episode ended; None while it runs."""
        return self._simulation.ending

    def errors(self) -> tuple[float, float | None]:
        """Tip and RCM error now [m]."""
        return errors(self._setup.plant.truth(), self.command, self._scenario.trocar is not None)

    def trace(self) -> Trace:
        """The trace of an episode that has ended.

        Raises:
            SurgsimError: If it has not.
        """
        if not self._simulation.ended:
            raise SurgsimError("the episode has not ended: it has no trace yet")
        return self._simulation.trace()

    def get_state(self) -> EpisodeState:
        """All that the episode is now.

        Raises:
            SurgsimError: If a part that is a Python object has a state that cannot be copied.
        """
        return EpisodeState(scenario=self._scenario, snapshot=self._simulation.snapshot())

    def set_state(self, state: EpisodeState) -> None:
        """Go on from `state`, of this episode or another one; what follows has the same bits as it had.

        Raises:
            SurgsimError: If it is of another scenario.
        """
        if state.scenario != self._scenario:
            if state.scenario != self._scenario.model_copy(update={"seed": state.scenario.seed}):
                raise SurgsimError(f"{self._scenario.name}: the state is of another scenario")
            self._scenario = state.scenario
            self.after_reset()
        self._simulation.restore(state.snapshot)

    def set_seed(self, seed: int) -> None:
        """Seed of the episode that is about to begin."""
        self._scenario = self._scenario.model_copy(update={"seed": seed})

    def set_control(self, control: ArrayLike) -> None:
        """The agent's action for the next ticks."""
        self._agent.action = np.array(control, dtype=float)

    def reset(self) -> None:
        """Nothing to do: `after_reset` builds the episode once its seed is known."""

    def after_reset(self) -> None:
        """Build the episode's plant and controller from its seed."""
        self._setup = self._prepare()
        self._simulation = Simulation(self._setup)

    def step(self, n_sub_steps: int = 1) -> None:
        """Run control ticks until they are done or the episode ends."""
        simulation = self._simulation
        for _ in range(n_sub_steps):
            simulation.tick()
            if simulation.due:  # the row of the last state, whose command never acts
                simulation.tick()
            if simulation.ended:
                return

    def time(self) -> float:
        """Simulated time [s]."""
        return self._simulation.state.t_s

    def timestep(self) -> float:
        """Control period [s]."""
        return self._scenario.simulation.control_period_s

    def _prepare(self) -> Setup:
        with offering(AGENT, self._agent):
            return prepare(self._scenario)
