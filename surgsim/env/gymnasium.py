"""Every shipped scenario as a Gymnasium environment; importing this module registers them.

`surgsim/Circle-LWR4Plus-v0` is the scenario `circle_lwr4plus`, and so on. Needs the extra `gymnasium`.
"""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.env.actions import Action
from surgsim.env.environment import DECIMATION, EnvironmentState, load
from surgsim.scenario.arms import ArmsScenario, Experiment
from surgsim.scenario.load import load_experiment, shipped
from surgsim.scenario.schema import Scenario

Observation = dict[str, Any]


class SurgsimEnv(gymnasium.Env[Observation, Any]):
    """`surgsim.env.load` with Gymnasium's interface; actions are scaled to [-1, 1].

    `terminated` is a safety limit passed or a controller that failed, `truncated` the task's end. `info` says
    how: `outcome` (`running`, `completed`, `rcm_limit`, ...), `detail`, `tip_error_mm`, `rcm_error_mm`.

    Args:
        scenario: Path or shipped name of a scenario, or one that is loaded.
        arm: See `surgsim.env.load`.
        action: See `surgsim.env.load`.
        resolver: See `surgsim.env.load`.
        decimation: See `surgsim.env.load`.
        assignments: `key.path=value` overrides of a scenario given by name.
        render_mode: None; a finished episode's trace can be recorded and inspected instead.

    Raises:
        SurgsimError: If the scenario or an argument is wrong.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 (Gymnasium's own type)

    def __init__(
        self,
        scenario: str | Experiment,
        *,
        arm: str | None = None,
        action: Action = "tip_velocity",
        resolver: str | PartConfig | None = None,
        decimation: int = DECIMATION,
        assignments: Sequence[str] = (),
        render_mode: str | None = None,
    ) -> None:
        if not isinstance(scenario, Scenario | ArmsScenario):
            scenario = load_experiment(scenario, assignments=assignments)
        self.environment = load(scenario, arm=arm, action=action, resolver=resolver, decimation=decimation)
        self.render_mode = render_mode
        self._scale = self.environment.action_spec().maximum
        self.action_space = spaces.Box(-1.0, 1.0, self._scale.shape, np.float64)
        self.observation_space = spaces.Dict(
            {
                name: spaces.Box(spec.minimum, spec.maximum, spec.shape, np.float64)
                for name, spec in self.environment.observation_spec().items()
            }
        )

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode; its seed is drawn from Gymnasium's generator."""
        super().reset(seed=seed)
        self.environment.task.reseed(int(self.np_random.integers(2**32)))
        return dict(self.environment.reset().observation), self._info()

    def step(self, action: Array) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """One step of `decimation` control ticks.

        Raises:
            gymnasium.error.ResetNeeded: If no episode has begun, or it has ended.
        """
        now = self.environment.step(self._scale * np.asarray(action, dtype=float))
        if now.first():
            raise gymnasium.error.ResetNeeded("no episode is running: call reset() before step()")
        over = now.last()
        lost = over and now.discount == 0.0
        return dict(now.observation), float(now.reward), lost, over and not lost, self._info()

    def get_state(self) -> EnvironmentState:
        """All that the environment is now, for `set_state`; see `surgsim.env.environment.Environment`."""
        return self.environment.get_state()

    def set_state(self, state: EnvironmentState) -> tuple[Observation, dict[str, Any]]:
        """Go on from `state`; the observation there, and its info.

        Raises:
            SurgsimError: If it is of another scenario.
        """
        self.environment.set_state(state)
        task, physics = self.environment.task, self.environment.physics
        return dict(task.get_observation(physics)), self._info()

    def _info(self) -> dict[str, Any]:
        task = self.environment.task
        tip, rcm = task.errors()
        ending = task.ending
        return {
            "outcome": "running" if ending is None else ending.outcome.name.lower(),
            "detail": "" if ending is None else ending.detail,
            "tip_error_mm": 1e3 * tip,
            "rcm_error_mm": float("nan") if rcm is None else 1e3 * rcm,
        }


def environment_id(scenario: str) -> str:
    """Gymnasium's id of a shipped scenario."""
    return f"surgsim/{'-'.join(map(_spelled, scenario.split('_')))}-v0"


def _spelled(word: str) -> str:
    """A word with a capital; letters before a number are an abbreviation."""
    letters, number, rest = re.fullmatch(r"(\D*)(\d*)(.*)", word).groups()  # type: ignore[union-attr]
    return f"{letters.upper()}{number}{rest.capitalize()}" if number else word.capitalize()


def register() -> None:
    """Register every shipped scenario that is not registered yet; one of several arms is made with `arm`."""
    for name in shipped():
        known = environment_id(name)
        if known not in gymnasium.registry:
            gymnasium.register(known, entry_point=f"{__name__}:SurgsimEnv", kwargs={"scenario": name})


register()
