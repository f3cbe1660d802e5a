"""The simulated operator: known laws of hand movement, and convergence under delay."""

from collections import deque

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surgsim.teleop.console import ConsoleConfig, new_console, step_console
from surgsim.teleop.goals import Goal, goal_rows
from surgsim.teleop.hand import HandAction
from surgsim.teleop.mapping import Mapping, MappingConfig, align, to_remote
from surgsim.teleop.operator import (
    Operator,
    OperatorConfig,
    OperatorLaw,
    describe_operator,
    operate,
)
from surgsim.teleop.reach import Reach, ReachConfig, ReachLaw, aim, movement_time, reach_at, scatter
from surgsim.teleop.tremor import TremorConfig, resonance, shake
from surgsim.tick.arrays import new
from surgsim.tick.overlay import take

PERIOD_S = 0.001
STILL = OperatorConfig(tremor=TremorConfig(rms_m=0.0), reach=ReachConfig(scatter_s=0.0, scatter_floor_m=0.0))


class Alone:
    """An operator at a console, with enough noise drawn for `periods`; what it does is in `action`."""

    def __init__(self, config, goals, *, scale=0.5, seed=0, periods=40_000):
        self._console, self.law, self.handle = new_console(ConsoleConfig())
        self.operator, self.state, self.action = new(OperatorLaw, 0), new(Operator, 0), new(HandAction, 0)
        noise = describe_operator(self.operator, config, PERIOD_S, 0.3)
        self.mapping = new(Mapping, 0)
        align(self.mapping, MappingConfig(scale=scale), self.handle.state.position, np.zeros(3))
        self.operator.goal_count, self.operator.scatter = len(goals), 3 * periods
        random = np.random.default_rng(seed)
        self._goals = goal_rows(goals).ravel()
        self._draws = random.standard_normal((2 * periods, 3))
        self._draws[:periods] *= noise

    def decide(self, t_s, seen):
        draws, handle = self._draws.ravel(), self.handle.state
        operate(self.operator, self._goals, self.state, draws, t_s, seen, handle, self.mapping, self.action)
        return self.action.copy()

    def move(self, wrench):
        step_console(self.law, self.handle, np.zeros(6), wrench)

    def tip(self):
        tip = np.zeros(3)
        to_remote(self.mapping, self.handle.state.position, tip)
        return tip


def reach_law(config):
    law = new(ReachLaw, 0)
    take(law, config)
    return law


def work_alone(goals, config=None, *, scale=0.5, delay_s=0.3, seed=0, duration_s=30.0):
    """Tip and actions of a run in which the tip copies the handle and is seen `delay_s` later."""
    alone = Alone(config or OperatorConfig(), goals, scale=scale, seed=seed)
    screen = deque([np.zeros(3)] * (round(delay_s / PERIOD_S) + 1), maxlen=round(delay_s / PERIOD_S) + 1)
    tips, actions = [], []
    for k in range(round(duration_s / PERIOD_S)):
        screen.append(alone.tip())
        actions.append(alone.decide(k * PERIOD_S, screen[0]))
        alone.move(actions[-1].wrench)
        tips.append(alone.tip())
        if actions[-1].done:
            break
    return np.array(tips), actions


def test_minimum_jerk_against_its_boundary_conditions_and_peak():
    reach = new(Reach, 0)
    reach.start_s, reach.duration_s, reach.change[0] = 1.0, 0.8, 0.1
    times = np.linspace(0.9, 2.0, 4001)
    p, v = np.zeros((4001, 3)), np.zeros((4001, 3))
    for k, t in enumerate(times):
        reach_at(reach, t, p[k], v[k])
    assert p[0] == pytest.approx(np.zeros(3), abs=0.0)
    assert p[-1] == pytest.approx(reach.change)
    assert v.max() == pytest.approx(1.875 * 0.1 / 0.8, rel=1e-4)
    assert np.gradient(p[:, 0], times) == pytest.approx(v[:, 0], abs=1e-5)
    assert np.abs(np.gradient(v[:, 0], times)[[0, -1]]).max() < 1e-9


def test_duration_follows_fitts_and_the_speed_limit():
    law = reach_law(ReachConfig(speed_limit_m_per_s=10.0))
    times = [movement_time(law, 0.1, width) for width in (0.01, 0.005, 0.0025)]
    assert np.diff(times) == pytest.approx([0.15, 0.15])
    assert times[0] == pytest.approx(0.1 + 0.15 * np.log2(20.0))
    slow = reach_law(ReachConfig(speed_limit_m_per_s=0.05))
    assert 1.875 * 0.1 / movement_time(slow, 0.1, 0.01) == pytest.approx(0.05)


def test_end_points_scatter_more_when_faster():
    law, rng = reach_law(ReachConfig(speed_limit_m_per_s=10.0)), np.random.default_rng(0)
    target, reach = np.array([0.1, 0.0, 0.0]), new(Reach, 0)

    def missed(width):
        aim(law, reach, target, width, 0.0, rng.standard_normal(3))
        return reach.change - target

    spread = []
    for width in (0.04, 0.002):
        spread.append(np.std([missed(width) for _ in range(1500)]))
        assert spread[-1] == pytest.approx(scatter(law, 0.1, movement_time(law, 0.1, width)), rel=0.05)
    assert spread[0] > spread[1]


def test_tremor_has_its_amplitude_and_band():
    a1, a2, noise = resonance(TremorConfig(), PERIOD_S)
    last, before, x = np.zeros(3), np.zeros(3), np.zeros((102_000, 3))
    for k, row in enumerate(noise * np.random.default_rng(0).standard_normal(x.shape)):
        shake(a1, a2, row, last, before)
        x[k] = last
    x = x[2000:]
    assert x.std(axis=0) == pytest.approx(np.full(3, 7e-5), rel=0.1)
    power = np.abs(np.fft.rfft(x, axis=0)) ** 2
    frequency = np.fft.rfftfreq(len(x), PERIOD_S)
    inside = power[(frequency > 8.0) & (frequency < 12.0)].sum() / power.sum()
    assert inside == pytest.approx(2.0 / np.pi * np.arctan(2.0), abs=0.03)
    assert np.array_equal(before, x[-2])


@pytest.mark.parametrize("scale", [0.25, 1.0])
@pytest.mark.parametrize("seed", [0, 1])
def test_reaches_its_goals_seen_with_a_round_trip_of_delay(scale, seed):
    goals = (
        Goal(position=(0.02, 0.0, 0.0)),
        Goal(position=(0.02, 0.03, 0.01), tolerance_m=0.001),
        Goal(position=(0.0, 0.0, 0.0), jaw=1.0),
    )
    tips, commands = work_alone(goals, scale=scale, seed=seed)
    assert commands[-1].done
    assert commands[-1].missed == 0
    index = np.array([command.goal for command in commands])
    for i, goal in enumerate(goals):
        last = tips[np.flatnonzero(index == i)[-1]]
        assert np.linalg.norm(last - goal.position) < 2.0 * goal.tolerance_m
    assert commands[-1].jaw == pytest.approx(1.0)


def test_the_first_movement_begins_after_the_reaction_time():
    _, commands = work_alone((Goal(position=(0.03, 0.0, 0.0)),), STILL, duration_s=1.0)
    force = np.array([np.linalg.norm(command.wrench[:3]) for command in commands])
    assert force[:195].max() < 1e-6
    assert force[220:400].max() > 0.1


def test_a_push_stays_beyond_the_wall_for_its_dwell_without_looking():
    goal = Goal(position=(0.04, 0.0, 0.0), push=True, dwell_s=1.5)
    tips, commands = work_alone((goal,), STILL)
    assert commands[-1].done
    assert len(tips) * PERIOD_S == pytest.approx(0.2 + 1.5 + 1.875 * 0.08 / 0.15, abs=0.02)
    assert tips[-1] == pytest.approx([0.04, 0.0, 0.0], abs=2e-3)


def test_a_goal_out_of_reach_is_given_up_and_counted():
    goals = (Goal(position=(0.5, 0.0, 0.0), timeout_s=2.0), Goal(position=(0.02, 0.0, 0.0)))
    _, commands = work_alone(goals, STILL)
    assert commands[-1].done
    assert commands[-1].missed == 1


def test_hand_force_is_the_impedance_law():
    alone = Alone(STILL, ())
    start = alone.handle.state.copy()
    assert alone.decide(0.0, np.zeros(3)).done
    alone.move(np.array([2.0, 1.0, -1.0, 0.0, 0.1, 0.0]))
    moved = alone.handle.state
    found = alone.decide(PERIOD_S, np.zeros(3)).wrench
    assert found[:3] == pytest.approx(135.0 * (start.position - moved.position) - 6.45 * moved.velocity)
    turn = Rotation.from_matrix(moved.rotation @ start.rotation.T).as_rotvec()
    assert found[3:] == pytest.approx(-0.15 * turn - 0.003 * moved.angular_velocity, rel=1e-6, abs=1e-12)
    assert np.abs(turn).max() > 1e-6


def test_same_noise_same_forces():
    goals = (Goal(position=(0.02, 0.01, 0.0)),)
    runs = [work_alone(goals, seed=seed)[0] for seed in (5, 5, 6)]
    assert np.array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0][:500], runs[2][:500])
