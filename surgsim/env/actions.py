"""What an agent's action is, and the controller that carries it out."""

from collections.abc import Mapping
from typing import Any, Literal, get_args

import numpy as np
from dm_env import specs

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.control.controller import ControllerConfig
from surgsim.control.resolvers import RESOLVERS
from surgsim.control.resolvers.base import ResolverConfig
from surgsim.control.resolvers.pinv import PinvConfig
from surgsim.control.resolvers.policy import PolicyConfig
from surgsim.control.torque_laws.joint_impedance import JointImpedanceConfig
from surgsim.control.torque_laws.joint_reference import JointReferenceConfig
from surgsim.control.torque_laws.policy import PolicyLawConfig
from surgsim.errors import SurgsimError, unknown_name
from surgsim.models.build import JointLimits
from surgsim.scenario.arms import ArmsScenario, Experiment
from surgsim.scenario.schema import Scenario

Action = Literal["tip_velocity", "joint_velocity", "torque"]
AGENT = "agent"
"""Name of the agent's controller and policy in an episode's scenario."""


class Agent:
    """The policy of an episode: it gives the action that the environment was stepped with."""

    def __init__(self) -> None:
        self.action: Array = np.zeros(0)

    def __call__(self, observation: Mapping[str, Array]) -> Array:
        """The action; the agent has looked at the observation that the environment gave it."""
        return self.action


def with_agent(
    scenario: Scenario, action: Action, resolver: str | PartConfig | None, decimation: int
) -> Scenario:
    """`scenario` with a controller that asks the agent.

    Args:
        scenario: The scenario.
        action: What the agent's action is.
        resolver: Resolves tip velocities: a resolver's name or config; None: the scenario's own.
        decimation: Control ticks for which an action holds.

    Raises:
        SurgsimError: If the plant does not take such an action, or there is no such resolver.
    """
    if action not in get_args(Action):
        raise SurgsimError(unknown_name(action, "kind of action", get_args(Action)))
    if decimation < 1:
        raise SurgsimError(f"decimation {decimation} is not allowed: must be 1 or more")
    if resolver is not None and action != "tip_velocity":
        raise SurgsimError(f"a resolver is for tip velocities, not for the action '{action}'")
    if action == "torque" and not scenario.plant.uses_torque:
        raise SurgsimError(f"the '{scenario.plant.type}' plant takes no torque: choose another action")
    if action == "torque" and scenario.takes_joint_reference:
        raise SurgsimError("robot.drive.command joint_impedance takes no torque: choose another action")
    own = scenario.controller
    asked: ResolverConfig = PinvConfig()  # with torques, its answer is recorded and not used
    law = own.torque_law
    if action == "torque":
        law = PolicyLawConfig(name=AGENT, add_bias=False, decimation=decimation)
    elif action == "joint_velocity":
        asked = PolicyConfig(name=AGENT, action=action, decimation=decimation)
        # other laws hold the RCM and would resist joint velocities that do not
        follows = law is None or isinstance(law, JointImpedanceConfig | JointReferenceConfig)
        law = law if follows else JointImpedanceConfig()
    else:
        inner: Any = _inner(own.resolver if resolver is None else resolver)
        asked = PolicyConfig(name=AGENT, action=action, resolver=inner, decimation=decimation)
    controller = ControllerConfig(
        name=AGENT,
        resolver=asked,
        torque_law=law,
        position_gain_per_s=own.position_gain_per_s,
        limit_zone_rad=own.limit_zone_rad,
    )
    return scenario.model_copy(update={"controller": controller})


def with_agent_at(
    scenario: Experiment,
    arm: str | None,
    action: Action,
    resolver: str | PartConfig | None,
    decimation: int,
) -> Experiment:
    """`scenario` with an agent as `with_agent`; of several arms it drives one, and the others stay.

    Raises:
        SurgsimError: As `with_agent`, and if it is not said which of several arms, or there is but one.
    """
    if not isinstance(scenario, ArmsScenario):
        if arm is not None:
            raise SurgsimError(f"{scenario.name} has one arm: leave out arm, '{arm}'")
        return with_agent(scenario, action, resolver, decimation)
    if arm is None:
        raise SurgsimError(
            f"{scenario.name} has the arms {', '.join(scenario.names)}: say by arm which one the agent "
            "drives; the others have their own controllers"
        )
    controller = with_agent(scenario.of(arm), action, resolver, decimation).controller
    arms = tuple(
        one.model_copy(update={"controller": controller}) if one.name == arm else one for one in scenario.arms
    )
    return scenario.model_copy(update={"arms": arms})


def action_spec(scenario: Scenario, limits: JointLimits) -> specs.BoundedArray:
    """Bounds of the actions in a scenario with an agent; what is outside is cut."""
    resolver = scenario.controller.resolver
    if not isinstance(resolver, PolicyConfig):
        return _symmetric("torque", limits.torque)
    if resolver.action == "joint_velocity":
        return _symmetric("joint_velocity", limits.velocity)
    return _symmetric("tip_velocity", np.full(3, resolver.tip_speed_max_m_per_s))


def _inner(resolver: str | PartConfig | ResolverConfig) -> PartConfig:
    if isinstance(resolver, PolicyConfig):
        return _inner(resolver.resolver)
    if isinstance(resolver, PartConfig):
        return resolver
    assert isinstance(resolver, str)
    if resolver == "policy":
        raise SurgsimError("resolver 'policy' asks a policy itself: name the one below it")
    return RESOLVERS.config(resolver)()


def _symmetric(name: str, limit: Array) -> specs.BoundedArray:
    return specs.BoundedArray(limit.shape, np.float64, minimum=-limit, maximum=limit, name=name)
