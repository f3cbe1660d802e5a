"""The instrument's roll, led by the turn of the console's grip through the channel."""

import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surgsim.errors import ScenarioError
from surgsim.metrics.catalog import METRICS
from surgsim.models.arm import ArmModel
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import prepare
from surgsim.teleop.hand import HandCommand
from surgsim.teleop.roll import RollConfig, RollLaw, describe_roll, rate_about, roll_rate, turn_grip
from surgsim.tick.arrays import new

T = 0.001
GOALS = "task.goals=[{position_m: [0.02, 0.65, -0.03], roll_deg: 60}, {position_m: [0.0, 0.66, -0.04]}]"
ON = "task.roll.use=true"


def rolled(*assignments, hand=None):
    setup = prepare(load_scenario("teleop_free_motion_panda", assignments=(GOALS, *assignments)))
    if hand is not None:
        setup.task.hold(hand)
    return setup, Simulation(setup).run()


def test_the_grip_is_turned_about_its_own_axis():
    upright = Rotation.random(rng=np.random.default_rng(0)).as_matrix()
    turned = np.zeros((3, 3))
    turn_grip(upright, 0.7, turned)
    assert turned == pytest.approx(
        (Rotation.from_matrix(upright) * Rotation.from_euler("x", 0.7)).as_matrix()
    )
    turn_grip(upright, 0.0, turned)
    assert np.array_equal(turned, upright)
    w = np.array([0.3, -0.2, 0.5])
    assert [rate_about(upright, axis, w) for axis in range(3)] == pytest.approx(upright.T @ w)


def test_the_rate_is_as_received_and_draws_an_error_back():
    law = new(RollLaw, 0)
    describe_roll(law, RollConfig(use=True, gain_per_s=3.0))
    assert roll_rate(law, 0.5, 0.2, 1.0, 0.9) == pytest.approx(0.5 * (0.2 + 3.0 * 0.1))
    describe_roll(law, RollConfig())
    assert roll_rate(law, 0.5, 0.2, 1.0, 0.9) == 0.0


def test_the_instrument_rolls_as_far_as_the_grip_was_turned():
    setup, run = rolled(ON, "task.channel.loss=0.1")
    first = np.flatnonzero(run["goal"] == 0.0)[-1]
    assert run["roll_command_rad"][first + 150] == pytest.approx(np.radians(60.0), abs=0.02)
    assert run["roll_command_rad"][-1] == pytest.approx(0.0, abs=0.02)
    assert METRICS["roll_error_rms_deg"].compute(run) < 1.5
    assert METRICS["rcm_error_max_mm"].compute(run) < 0.05
    assert METRICS["energy_residual_fraction"].compute(run) < 0.01
    arm: ArmModel = setup.arm
    frames = [Rotation.from_matrix(arm.kinematics(q).R_WT) for q in run.block("q")[::20]]
    steps = [(before.inv() * after).as_rotvec()[2] for before, after in itertools.pairwise(frames)]
    assert run["roll_rad"][::20][1:] == pytest.approx(np.cumsum(steps), abs=5e-3)


def test_without_it_nothing_rolls_and_there_is_no_error():
    _, run = rolled(GOALS.replace(", roll_deg: 60", ""))
    assert run["operator_done"][-1]
    assert (run["roll_command_rad"] == 0.0).all()
    assert np.abs(run["roll_rad"]).max() < 0.01
    assert np.isnan(METRICS["roll_error_rms_deg"].compute(run))


def test_the_roll_comes_by_the_channel():
    onsets = {}
    for delay in (0.05, 0.25):
        _, run = rolled(ON, f"task.channel={{delay_s: {delay}}}", "task.duration_s=1.5")
        onsets[delay] = int(np.argmax(run["roll_command_rad"] > 1e-3))
    assert onsets[0.25] - onsets[0.05] == pytest.approx(200, abs=1)


def test_the_operator_stays_at_a_goal_until_the_grip_is_turned():
    _, run = rolled(ON, "task.operator.roll_speed_rad_per_s=0.25")
    assert run["t_s"][run["goal"] == 0.0][-1] == pytest.approx(np.radians(60.0) / 0.25, abs=0.1)
    assert run["operator_done"][-1]


class Turning:
    """Turns the grip, from 0.5 s on with the pedal pressed."""

    def step(self, t_s, seen_tip, handle):
        torque = 2e-3 - 2e-3 * handle.angular_velocity[0]
        wrench = np.array([0.0, 0.0, 0.0, torque, 0.0, 0.0])
        return HandCommand(wrench=wrench, jaw=0.0, goal=0, done=t_s > 0.9, missed=0, clutch=t_s > 0.5)


def test_an_open_clutch_passes_on_no_roll():
    _, run = rolled(ON, hand=Turning())
    opened = np.flatnonzero(run["clutch_engaged"] == 0.0)
    arrived = run["roll_command_rad"][opened[0] + 151 :]
    assert arrived[0] > 0.02
    assert np.ptp(arrived) == 0.0


def test_a_roll_that_nothing_would_follow_is_refused():
    with pytest.raises(ScenarioError, match=r"roll_deg of a goal turns the grip alone: roll.use"):
        load_scenario("teleop_free_motion_panda", assignments=(GOALS,))
    with pytest.raises(ScenarioError, match=r"resolver 'pinv' leaves the roll free: passive_qp and"):
        load_scenario("teleop_free_motion_panda", controller="joint_impedance", assignments=(GOALS, ON))
