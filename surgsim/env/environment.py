"""Loading a scenario as a `dm_control` environment."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from dm_control.rl import control

from surgsim.catalog import PartConfig
from surgsim.env.actions import Action, with_agent_at
from surgsim.env.physics import EpisodeState, SurgsimPhysics
from surgsim.env.task import ScenarioTask
from surgsim.scenario.arms import ArmsScenario, Experiment
from surgsim.scenario.load import load_experiment
from surgsim.scenario.schema import Scenario

DECIMATION = 20
"""Control ticks per step of an environment: 50 Hz at the default control period."""


@dataclass(frozen=True, kw_only=True)
class EnvironmentState:
    """An environment between two steps.

    Attributes:
        episode: The episode.
        over: Whether it has ended, or none has begun.
        steps: Steps of it.
        random: Where the episodes' seeds come from.
    """

    episode: EpisodeState
    over: bool
    steps: int
    random: Mapping[str, Any]


class Environment(control.Environment):
    """`dm_control`'s environment whose state can be taken and put back."""

    def get_state(self) -> EnvironmentState:
        """All that the environment is now, the seeds of its coming episodes included.

        Raises:
            SurgsimError: If a part that is a Python object has a state that cannot be copied.
        """
        return EnvironmentState(
            episode=self.physics.get_state(),
            over=self._reset_next_step,
            steps=self._step_count,
            random=self.task.random_state,
        )

    def set_state(self, state: EnvironmentState) -> None:
        """Go on from `state`, taken from this environment or another one of the same scenario.

        Raises:
            SurgsimError: If it is of another scenario.
        """
        self.physics.set_state(state.episode)
        self._reset_next_step, self._step_count = state.over, state.steps
        self.task.random_state = state.random


def load(
    scenario: str | Experiment,
    *,
    arm: str | None = None,
    action: Action = "tip_velocity",
    resolver: str | PartConfig | None = None,
    decimation: int = DECIMATION,
    seed: int | None = None,
) -> "Environment":
    """A scenario as an environment.

    The same seed gives the same episodes bit for bit, each with a seed of its own, drawn from it.

    Args:
        scenario: Path or shipped name of a scenario, or one that is loaded.
        arm: Of several arms the one that the agent drives; the others have their own controllers.
        action: `tip_velocity` (3) [m/s], which the resolver and the scenario's torque law turn into torques;
            `joint_velocity` (n) [rad/s], which joint impedance does; or `torque` (n) [N m].
        resolver: Resolves tip velocities: a resolver's name or config; None: the scenario's own.
        decimation: Control ticks for which an action holds.
        seed: Of the sequence of episodes; None: the scenario's.

    Raises:
        SurgsimError: If the scenario or an argument is wrong.
    """
    if not isinstance(scenario, Scenario | ArmsScenario):
        scenario = load_experiment(scenario)
    physics = SurgsimPhysics(with_agent_at(scenario, arm, action, resolver, decimation), arm)
    task = ScenarioTask(physics, scenario.seed if seed is None else seed)
    return Environment(physics, task, n_sub_steps=decimation)
