"""Loading a scenario as a `dm_control` environment."""

from dm_control.rl import control

from surgsim.catalog import PartConfig
from surgsim.env.actions import Action, with_agent
from surgsim.env.physics import SurgsimPhysics
from surgsim.env.task import ScenarioTask
from surgsim.scenario.load import load_scenario
from surgsim.scenario.schema import Scenario

DECIMATION = 20
"""Control ticks per step of an environment: 50 Hz at the default control period."""


def load(
    scenario: str | Scenario,
    *,
    action: Action = "tip_velocity",
    resolver: str | PartConfig | None = None,
    decimation: int = DECIMATION,
    seed: int | None = None,
) -> control.Environment:
    """A scenario as an environment.

    The same seed gives the same episodes bit for bit, each with a seed of its own, drawn from it.

    Args:
        scenario: Path or shipped name of a scenario, or one that is loaded.
        action: `tip_velocity` (3) [m/s], which the resolver and the scenario's torque law turn into torques;
            `joint_velocity` (7) [rad/s], which joint impedance does; or `torque` (7) [N m].
        resolver: Resolves tip velocities: a resolver's name or config; None: the scenario's own.
        decimation: Control ticks for which an action holds.
        seed: Of the sequence of episodes; None: the scenario's.

    Raises:
        SurgsimError: If the scenario or an argument is wrong.
    """
    if not isinstance(scenario, Scenario):
        scenario = load_scenario(scenario)
    physics = SurgsimPhysics(with_agent(scenario, action, resolver, decimation))
    task = ScenarioTask(physics, scenario.seed if seed is None else seed)
    return control.Environment(physics, task, n_sub_steps=decimation)
