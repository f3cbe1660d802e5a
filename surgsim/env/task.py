"""What an agent is asked to do, as a `dm_control` task."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from dm_control.rl import control
from dm_env import specs
from numpy.typing import ArrayLike

from surgsim.env.actions import action_spec
from surgsim.env.observations import Observations, Specs, observation_of, observation_spec
from surgsim.env.physics import SurgsimPhysics
from surgsim.env.rewards import reward
from surgsim.errors import Outcome
from surgsim.trace.trace import Ending, Trace


class ScenarioTask(control.Task):
    """The scenario's task, trocar and safety limits, of several arms those of the agent's.

    An episode that reaches the task's end is cut off there (discount 1); one that passes a safety limit, or
    whose controller fails, is lost (discount 0), and with it the rewards that were still to come. With
    several arms it goes on until all tasks are done, and what ends it may be another arm's.

    Args:
        physics: The physics that it is for.
        seed: Of the sequence of the episodes' seeds.
    """

    def __init__(self, physics: SurgsimPhysics, seed: int) -> None:
        self._physics = physics
        self._action = action_spec(physics.setup.scenario, physics.setup.scene.limits)
        self._observation = observation_spec(physics.setup, physics.duration_s)
        self.reseed(seed)

    @property
    def ending(self) -> Ending | None:
        """How the last episode ended, with outcome and detail; None while it runs."""
        return self._physics.ending

    @property
    def episode_seed(self) -> int:
        """Seed of the episode's scenario."""
        return self._physics.scenario.seed

    def trace(self) -> Trace:
        """The trace of the last episode, for the metrics.

        Raises:
            SurgsimError: If it has not ended.
        """
        return self._physics.trace()

    def errors(self) -> tuple[float, float | None]:
        """Tip and RCM error now [m]; no RCM error without a trocar."""
        return self._physics.errors()

    def reseed(self, seed: int) -> None:
        """Begin the sequence of episodes that belongs to `seed`."""
        self._random = np.random.default_rng(np.random.SeedSequence(seed))

    @property
    def random_state(self) -> Mapping[str, Any]:
        """Where in the sequence of the episodes' seeds it is."""
        return self._random.bit_generator.state

    @random_state.setter
    def random_state(self, state: Mapping[str, Any]) -> None:
        self._random.bit_generator.state = state

    def initialize_episode(self, physics: SurgsimPhysics) -> None:
        """Draw the episode's seed."""
        physics.set_seed(int(self._random.integers(2**32)))

    def before_step(self, action: ArrayLike, physics: SurgsimPhysics) -> None:
        """Hand over the agent's action; what is outside its bounds is cut."""
        physics.set_control(action)

    def action_spec(self, physics: SurgsimPhysics) -> specs.BoundedArray:
        """Name, shape and bounds of an action."""
        return self._action

    def observation_spec(self, physics: SurgsimPhysics) -> Specs:
        """Names, shapes and bounds of an observation."""
        return self._observation

    def get_observation(self, physics: SurgsimPhysics) -> Observations:
        """What a controller sees at the present tick."""
        return observation_of(physics.setup, physics.state, physics.command, self._observation)

    def get_reward(self, physics: SurgsimPhysics) -> float:
        """See `surgsim.env.rewards.reward`."""
        return reward(*physics.errors())

    def get_termination(self, physics: SurgsimPhysics) -> float | None:
        """Final discount of an episode that has ended, else None."""
        if physics.ending is None:
            return None
        return 1.0 if physics.ending.outcome is Outcome.COMPLETED else 0.0

    def step_spec(self, physics: SurgsimPhysics) -> Any:
        """Not defined: the environment's reward, discount and observation specs say it all."""
        raise NotImplementedError
