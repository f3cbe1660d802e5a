"""Observations: what every policy sees, with bounds."""

from collections import OrderedDict

import numpy as np
from dm_env import specs

from surgsim.array import Array
from surgsim.control.policies.observation import observe
from surgsim.control.rcm import rcm_kinematics
from surgsim.plant.state import State
from surgsim.scenario.schema import Scenario
from surgsim.simulate.setup import Setup
from surgsim.tasks.base import TipCommand

Observations = OrderedDict[str, Array]
Specs = OrderedDict[str, specs.BoundedArray]

_REACH_M = 3.0
_SPEED_M_PER_S = 10.0
_ACCELERATION_M_PER_S2 = 1000.0
_JOINT_MARGIN_RAD = 0.5
_JOINT_SPEED_MARGIN = 2.0


def observation_of(setup: Setup, state: State, command: TipCommand, bounds: Specs) -> Observations:
    """The observation at `state`, see `surgsim.control.policies.observation.observe`, cut at `bounds`.

    The bounds lie outside what a run can reach before its safety limits stop it; only a state that is not
    finite, or far beyond a limit, is changed by the cut.
    """
    kin = setup.arm.kinematics(state.q)
    has_trocar = setup.scenario.trocar is not None
    seen = {
        "t_s": np.array([state.t_s]),
        "q": state.q,
        "v": state.v,
        "p_WT": kin.p_WT,
        "p_WTd": command.p_WTd,
        "v_WTd": command.v_WTd,
        "a_WTd": command.a_WTd,
        "has_trocar": np.array([float(has_trocar)]),
        "p_WC": state.p_WC,
        "v_WC": state.v_WC,
    }
    if has_trocar:
        rcm = rcm_kinematics(kin, state.p_WC, state.v_WC)
        seen["rcm_error"], seen["depth"] = rcm.error, np.array([rcm.depth])
    return OrderedDict((name, _cut(value, bounds[name])) for name, value in observe(seen).items())


def observation_spec(setup: Setup, duration_s: float) -> Specs:
    """Shapes and bounds of the observation in an episode of at most `duration_s` [s], in order."""
    scenario, limits = setup.scenario, setup.scene.limits
    reach = _REACH_M + _away(scenario)
    speed, ones = _JOINT_SPEED_MARGIN * limits.velocity, np.ones(3)
    bounds: dict[str, tuple[Array, Array]] = {
        "time": (np.zeros(1), np.array([duration_s + scenario.simulation.control_period_s])),
        "joint_position": (limits.q_min - _JOINT_MARGIN_RAD, limits.q_max + _JOINT_MARGIN_RAD),
        "joint_velocity": (-speed, speed),
        "tip_position": (-reach * ones, reach * ones),
        "tip_error": (-reach * ones, reach * ones),
        "command_velocity": (-_SPEED_M_PER_S * ones, _SPEED_M_PER_S * ones),
        "command_acceleration": (-_ACCELERATION_M_PER_S2 * ones, _ACCELERATION_M_PER_S2 * ones),
    }
    if scenario.trocar is not None:
        bounds["rcm_error"] = (-reach * np.ones(2), reach * np.ones(2))
        bounds["insertion_depth"] = (np.array([-reach]), np.array([reach]))
        bounds["trocar_position"] = (-reach * ones, reach * ones)
        bounds["trocar_velocity"] = (-_SPEED_M_PER_S * ones, _SPEED_M_PER_S * ones)
    return OrderedDict(
        (name, specs.BoundedArray(low.shape, np.float64, minimum=low, maximum=high, name=name))
        for name, (low, high) in bounds.items()
    )


def _away(scenario: Scenario) -> float:
    """How far the robot stands from the world's origin [m]."""
    return float(np.linalg.norm(scenario.robot.base_position_m))


def _cut(value: Array, bounds: specs.BoundedArray) -> Array:
    low, high = bounds.minimum, bounds.maximum
    finite = np.where(np.isnan(value), 0.5 * (low + high), value)
    return np.asarray(np.minimum(np.maximum(finite, low), high), dtype=float)
