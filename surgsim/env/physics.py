"""surgsim's simulation as a `dm_control` physics."""

from dataclasses import dataclass

import numpy as np
from dm_control.rl import control
from numpy.typing import ArrayLike

from surgsim.control.policies.registry import offering
from surgsim.env.actions import AGENT, Agent
from surgsim.env.rewards import errors
from surgsim.errors import SurgsimError
from surgsim.plant.state import State
from surgsim.scenario.arms import Experiment
from surgsim.simulate.arms_setup import ArmsSetup
from surgsim.simulate.loop import Simulation, prepared
from surgsim.simulate.setup import Setup
from surgsim.simulate.snapshot import Snapshot
from surgsim.tasks.base import TipCommand
from surgsim.tasks.command import command_of
from surgsim.trace.trace import Ending, Trace


@dataclass(frozen=True, kw_only=True)
class EpisodeState:
    """An episode at a tick: its scenario, seed included, and the run."""

    scenario: Experiment
    snapshot: Snapshot


class SurgsimPhysics(control.Physics):
    """Runs a scenario with an agent tick by tick; its timestep is the control period.

    The episode is a `Simulation` like any other: its plant is the only writer of MuJoCo's data, its safety
    monitor ends it, and it gives a trace.

    Args:
        scenario: A scenario with an agent, see `with_agent`.
        arm: Of several arms the one that the agent drives.

    Raises:
        SurgsimError: If the scenario cannot be started.
    """

    def __init__(self, scenario: Experiment, arm: str | None = None) -> None:
        self._scenario, self._arm = scenario, arm
        self._agent = Agent()
        self._begin()

    def _begin(self) -> None:
        """Build the episode."""
        with offering(AGENT, self._agent):
            whole = prepared(self._scenario)
        self._duration_s = whole.duration_s
        self._setup = whole.arms[self._arm or ""] if isinstance(whole, ArmsSetup) else whole
        self._simulation = Simulation(whole)

    @property
    def scenario(self) -> Experiment:
        """The scenario of the episode."""
        return self._scenario

    @property
    def duration_s(self) -> float:
        """How long the episode lasts at most [s]."""
        return self._duration_s

    @property
    def setup(self) -> Setup:
        """The built parts of the agent's arm."""
        return self._setup

    @property
    def state(self) -> State:
        """What the controller of the agent's arm sees now."""
        return self._setup.plant.state()

    @property
    def command(self) -> TipCommand:
        """What the task of the agent's arm asks for now."""
        return command_of(self._setup.controller.control.command)

    @property
    def ending(self) -> Ending | None:
        """How the episode ended; None while it runs."""
        return self._simulation.ending

    def errors(self) -> tuple[float, float | None]:
        """Tip and RCM error of the agent's arm now [m]."""
        has_trocar = self._setup.scenario.trocar is not None
        return errors(self._setup.plant.truth(), self.command, has_trocar)

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
        self._begin()

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
        return self._simulation.time_s

    def timestep(self) -> float:
        """Control period [s]."""
        return self._scenario.simulation.control_period_s
