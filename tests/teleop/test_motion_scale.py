"""Motion scaling that changes during a run: continuous, and without a step in the command."""

import numpy as np
import pytest
from pydantic import ValidationError

from surgsim.teleop.bilateral.wave_variables import WaveVariablesConfig
from surgsim.teleop.console import ConsoleConfig, new_console
from surgsim.teleop.manual.hand import LiveHand
from surgsim.teleop.manual.intent import Intent
from surgsim.teleop.mapping import MappingConfig, MappingLaw, describe_mapping, scale_at
from surgsim.teleop.operator import OperatorConfig
from surgsim.tick.arrays import new

CHANGES = ({"at_s": 1.0, "scale": 0.2}, {"at_s": 4.0, "scale": 0.9})
CHANGING = MappingConfig(scale=0.5, scale_changes=CHANGES)


def scales(config, times):
    law = new(MappingLaw, 0)
    describe_mapping(law, config, 0.001)
    return np.array([scale_at(law, config.change_rows().ravel(), t) for t in times])


def test_the_scale_goes_along_half_a_cosine_and_stays():
    found = scales(CHANGING, np.array([0.0, 1.0, 1.125, 1.25, 1.5, 3.0, 4.25, 4.5, 9.0]))
    first = 0.5 - 0.3 * (1.0 - np.cos(np.pi * 0.25)) / 2.0
    assert found == pytest.approx([0.5, 0.5, first, 0.35, 0.2, 0.2, 0.55, 0.9, 0.9], abs=1e-12)


def test_changes_that_overlap_are_continuous():
    config = CHANGING.model_copy(update={"scale_ramp_s": 5.0})
    found = scales(config, np.arange(0.0, 12.0, 0.001))
    assert np.abs(np.diff(found)).max() < 1e-3
    assert found[[0, -1]] == pytest.approx([0.5, 0.9], abs=0.0)


def test_changes_out_of_order_are_refused():
    with pytest.raises(ValidationError, match="scale_changes must be in order of time, not at_s 4, 1"):
        MappingConfig(scale_changes=CHANGES[::-1])


@pytest.mark.parametrize("bilateral", [None, WaveVariablesConfig()], ids=["tank", "wave_variables"])
def test_the_command_does_not_step_and_the_goals_are_reached(teleoperate, goal, bilateral):
    keys = {} if bilateral is None else {"bilateral": bilateral}
    goals = (goal(0.015, 0.01, 0.0), goal(0.0, 0.0, -0.01), goal(0.01, 0.0, 0.0))
    run = teleoperate(goals, mapping=CHANGING, **keys)
    assert run["done"][-1]
    assert run["goals_missed"][-1] == 0
    assert run["motion_scale"][-1] == 0.9
    issued, handle = (
        np.column_stack([run[f"{name}_{axis}_{unit}"] for axis in "xyz"])
        for name, unit in (("velocity_issued", "m_per_s"), ("handle", "m"))
    )
    velocity = np.column_stack([run[f"handle_velocity_{axis}_m_per_s"] for axis in "xyz"])
    assert issued == pytest.approx(run["motion_scale"][:, None] * velocity, abs=1e-15)
    changing = np.flatnonzero(np.diff(run["motion_scale"]) != 0.0)
    assert changing.size > 900
    # the tip that the handle stands for, by the message: it ends where the passed-on motion adds up to
    way = (run["motion_scale"][1:, None] * np.diff(handle, axis=0)).sum(axis=0)
    tip = np.array([run[f"{axis}_m"][-1] for axis in "xyz"])
    assert tip == pytest.approx(way, abs=1e-3)
    assert np.abs(way - 0.9 * (handle[-1] - handle[0])).max() > 2e-3  # the old offset would be wrong
    assert run["delivered_j"].max() <= run["tank_operator_j"][0] + run["tank_remote_j"][0] + 1e-3


def test_a_person_s_velocity_is_that_of_the_tip_at_any_scale():
    _console, _law, memory = new_console(ConsoleConfig())
    hand = LiveHand(OperatorConfig(), CHANGING, lambda t: Intent(velocity=(0.01, 0.0, 0.0)), 0.001)
    moved = {}
    for k in range(3000):
        moved[k] = hand.step(0.001 * k, np.zeros(3), memory.state).intended
        memory.state.position[:] = moved[k]
    for begin, scale in ((500, 0.5), (2500, 0.2)):
        speed = (moved[begin + 400] - moved[begin])[0] / 0.4
        assert speed == pytest.approx(0.01 / scale, rel=1e-3)
