"""Re-indexing with the clutch: no step in the command, no force while open, no energy made."""

import itertools

import numpy as np
import pytest

from surgsim.errors import SurgsimError
from surgsim.metrics.catalog import METRICS
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import prepare
from surgsim.teleop.bilateral.four_channel import FourChannelConfig
from surgsim.teleop.bilateral.wave_variables import WaveVariablesConfig
from surgsim.teleop.clutch import ClutchConfig
from surgsim.teleop.hand import HandCommand
from surgsim.teleop.mapping import (
    Mapping,
    MappingConfig,
    MappingLaw,
    align,
    describe_mapping,
    force_to_console,
    motion_to_remote,
    remap,
    to_remote,
)
from surgsim.teleop.operator import OperatorConfig
from surgsim.tick.arrays import new

T = 0.001
SMALL = MappingConfig(scale=0.15)
CLUTCHES = OperatorConfig(clutch=ClutchConfig(use=True))
FAR = (0.04, 0.0, 0.0)


def mapping_of(config):
    law, mapping = new(MappingLaw, 0), new(Mapping, 0)
    describe_mapping(law, config, T)
    align(mapping, config, [0.4, 0.1, 0.6], [0.1, 0.5, 0.2])
    return law, mapping


def test_what_the_handle_stands_for_is_the_integral_of_what_is_passed_on():
    config = MappingConfig(scale=0.4, rotation_wxyz=(0.8, 0.0, 0.6, 0.0), clutch_fade_s=0.05)
    law, mapping = mapping_of(config)
    times = T * np.arange(400)
    handle = np.array([0.4, 0.1, 0.6]) + 0.02 * np.sin(np.outer(times, [9.0, 5.0, 7.0]))
    told, power, engaged = [], [], []
    for p, after in itertools.pairwise(handle):
        remap(law, np.zeros(0), mapping, 0.0, p, int(100 <= len(told) < 250))
        before, now, force, f_W = np.zeros(3), np.zeros(3), np.zeros(3), np.array([1.0, -2.0, 0.5])
        to_remote(mapping, p, before)
        to_remote(mapping, after, now)
        if told:
            assert before == pytest.approx(told[-1], abs=1e-15)  # a new offset is no step
        force_to_console(mapping, f_W, force)
        power.append(force @ (after - p) - f_W @ (now - before))
        told.append(now)
        engaged.append(mapping.engaged)
    assert np.abs(power).max() < 1e-15
    rises = np.clip(np.interp(np.arange(399), [99, 149, 249, 299], [1.0, 0.0, 0.0, 1.0]), 0.0, 1.0)
    assert engaged == pytest.approx(0.5 - 0.5 * np.cos(np.pi * rises), abs=1e-12)
    steps = np.array(engaged)[:, None] * np.diff(handle, axis=0) @ (0.4 * mapping.R_WO.T)
    assert np.array(told) == pytest.approx(np.array([0.1, 0.5, 0.2]) + np.cumsum(steps, axis=0))
    assert np.ptp(told[150:250], axis=0) == pytest.approx(np.zeros(3), abs=0.0)


def test_a_clutch_that_stays_closed_changes_no_number():
    law, mapping = mapping_of(SMALL)
    before = mapping.copy()
    remap(law, np.zeros(0), mapping, 0.0, np.array([0.5, 0.2, 0.7]), 0)
    assert mapping == before
    velocity = np.zeros(3)
    motion_to_remote(mapping, np.array([0.1, 0.0, 0.0]), velocity)
    assert velocity[0] == 0.15 * 0.1


def columns(run, name, unit):
    return np.column_stack([run[f"{name}_{axis}_{unit}"] for axis in "xyz"])


def test_without_a_clutch_the_handle_ends_on_its_stop_and_with_it_the_goal_is_reached(teleoperate, goal):
    goals = (goal(*FAR), goal(0.0, 0.0, 0.0))
    stuck = teleoperate(goals, mapping=SMALL, duration_s=8.0)
    assert stuck["handle_stop"][-1] > 0
    assert stuck["goal"][-1] == 0
    assert (stuck["clutch_engaged"] == 1.0).all()
    run = teleoperate(goals, mapping=SMALL, operator=CLUTCHES, duration_s=40.0)
    assert run["done"][-1]
    assert run["goals_missed"][-1] == 0
    assert (run["handle_stop"] > 0).sum() < 500  # with the clutch open: the hand had led the handle
    assert (run["clutch_engaged"][run["handle_stop"] > 0] < 1.0).all()
    assert 0.15 * np.ptp(run["handle_x_m"]) < FAR[0] < np.ptp(run["x_m"]) + 0.002


SCHEMES = {
    "tank": {},
    "refilled tank": {"stiffness_n_per_m": 400.0, "refill_damping_ns_per_mj": 200.0},
    "tdpa": {"passivity": "tdpa"},
    "wave_variables": {"bilateral": WaveVariablesConfig()},
    "four_channel": {"bilateral": FourChannelConfig()},
}


@pytest.mark.parametrize("scheme", SCHEMES)
def test_an_open_clutch_shows_no_force_and_the_account_agrees(teleoperate, goal, scheme):
    goals = (goal(*FAR), goal(0.0, 0.0, 0.0))
    run = teleoperate(goals, mapping=SMALL, operator=CLUTCHES, duration_s=12.0, **SCHEMES[scheme])
    opened, force = run["clutch_engaged"] == 0.0, columns(run, "master_force", "n")
    assert opened.sum() > 500
    assert np.abs(force[opened]).max() == 0.0
    assert np.abs(force[~opened]).max() > 0.1
    issued = columns(run, "velocity_issued", "m_per_s")
    assert np.abs(issued[opened]).max() == 0.0
    assert np.abs(np.diff(issued, axis=0)).max() < 1.5e-3  # 1.5 m/s^2 of the tip, where the hand starts
    handle = columns(run, "handle", "m")
    work = (force[1:] * np.diff(handle, axis=0)).sum(axis=1)  # a force holds over the period that it ends
    exchanged = np.abs(np.diff(run["hand_work_j"])).sum()
    assert np.abs(run["rendered_work_j"][1:] - np.cumsum(work)).max() < 0.01 * exchanged
    assert np.abs(run["console_residual_j"]).max() < 0.01 * exchanged
    if scheme in ("tank", "refilled tank"):
        assert np.abs(run["tank_account_residual_j"]).max() < 1e-10
    if scheme != "four_channel":  # which feeds the delayed motion forward, and is active with any clutch
        assert run["delivered_j"].max() <= run["tank_operator_j"][0] + run["tank_remote_j"][0] + 1e-3


class Pedal:
    """Holds the pedal from 0.2 to 0.6 s while it pulls."""

    def step(self, t_s, seen_tip, handle):
        wrench = np.array([0.3, 0.0, 0.0, 0.0, 0.0, 0.0])
        return HandCommand(wrench=wrench, jaw=0.0, goal=0, done=t_s > 1.0, missed=0, clutch=0.2 < t_s < 0.6)


def test_the_whole_arm_waits_while_a_hand_in_python_presses_the_pedal():
    setup = prepare(load_scenario("teleop_free_motion_panda", assignments=("task.hold_end_s=0.3",)))
    setup.task.hold(Pedal())
    run = Simulation(setup).run()
    opened = run["clutch_engaged"] == 0.0
    assert opened.sum() == pytest.approx(300, abs=2)
    assert np.ptp(run["handle_x_m"][opened]) > 5e-3
    assert METRICS["clutchings"].compute(run) == 1.0
    scale = run.meta.scenario["task"]["mapping"]["scale"]  # with the clutch half closed too
    assert METRICS["motion_scale_mean"].compute(run) == pytest.approx(scale, rel=1e-9)
    assert METRICS["clutch_open_fraction"].compute(run) == np.mean(run["clutch_engaged"] < 1.0)


WALL = (
    "props.0.normal=[-1.0, 0.0, 0.0]",
    "props.0.point_m=[0.01, 0.65, -0.06]",
    "task.goals=[{position_m: [0.03, 0.65, -0.03], push: true, dwell_s: 0.5}]",
    "task.mapping.scale=0.15",
    "task.operator.clutch.use=true",
    "task.hold_end_s=0.3",
    "task.duration_s=12.0",
)


def test_a_clutching_while_the_tip_presses_is_booked_as_it_is():
    run = Simulation(prepare(load_scenario("teleop_wall_panda", assignments=WALL))).run()
    assert METRICS["clutchings"].compute(run) >= 1.0
    assert np.abs(run["tip_force_x_n"][run["clutch_engaged"] == 0.0]).max() > 1.0
    assert METRICS["energy_residual_fraction"].compute(run) < 0.01
    assert METRICS["tank_deficit_j"].compute(run) == 0.0
    assert METRICS["delivered_excess_j"].compute(run) < 0.0


def test_a_margin_wider_than_the_console_s_room_is_refused():
    with pytest.raises(SurgsimError, match=r"stop_margin_rad 0.6 must be below 0.5\d+, the way from"):
        load_scenario("teleop_free_motion_panda", assignments=("task.operator.clutch.stop_margin_rad=0.6",))
