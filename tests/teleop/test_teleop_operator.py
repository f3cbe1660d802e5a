"""The simulated operator: known laws of hand movement, and convergence under delay."""

from collections import deque

import numpy as np
import pytest

from surgsim.teleop.console import Console, ConsoleConfig
from surgsim.teleop.mapping import Mapping, MappingConfig
from surgsim.teleop.operator import Goal, Operator, OperatorConfig
from surgsim.teleop.reach import Reach, ReachConfig, aim, movement_time, scatter
from surgsim.teleop.tremor import Tremor, TremorConfig

PERIOD_S = 0.001
STILL = OperatorConfig(tremor=TremorConfig(rms_m=0.0), reach=ReachConfig(scatter_s=0.0, scatter_floor_m=0.0))


def work_alone(goals, config=None, *, scale=0.5, delay_s=0.3, seed=0, duration_s=30.0):
    """Tip and state of a run in which the tip copies the handle and is seen `delay_s` later."""
    console = Console(ConsoleConfig())
    state = console.state()
    mapping = Mapping.aligned(MappingConfig(scale=scale), state.position, np.zeros(3))
    operator = Operator(config or OperatorConfig(), goals, mapping, PERIOD_S, np.random.SeedSequence(seed))
    screen = deque([np.zeros(3)] * (round(delay_s / PERIOD_S) + 1), maxlen=round(delay_s / PERIOD_S) + 1)
    tips, commands = [], []
    for k in range(round(duration_s / PERIOD_S)):
        screen.append(mapping.to_remote(state.position))
        command = operator.step(k * PERIOD_S, screen[0], state)
        state = console.step(np.zeros(6), command.wrench)
        tips.append(mapping.to_remote(state.position))
        commands.append(command)
        if command.done:
            break
    return np.array(tips), commands


def test_minimum_jerk_against_its_boundary_conditions_and_peak():
    reach = Reach(start_s=1.0, duration_s=0.8, origin=np.zeros(3), change=np.array([0.1, 0.0, 0.0]))
    times = np.linspace(0.9, 2.0, 4001)
    p, v = (np.array(rows) for rows in zip(*map(reach.at, times), strict=True))
    assert p[0] == pytest.approx(np.zeros(3), abs=0.0)
    assert p[-1] == pytest.approx(reach.change)
    assert v.max() == pytest.approx(1.875 * 0.1 / 0.8, rel=1e-4)
    assert np.gradient(p[:, 0], times) == pytest.approx(v[:, 0], abs=1e-5)
    assert np.abs(np.gradient(v[:, 0], times)[[0, -1]]).max() < 1e-9


def test_duration_follows_fitts_and_the_speed_limit():
    config = ReachConfig(speed_limit_m_per_s=10.0)
    times = [movement_time(0.1, width, config) for width in (0.01, 0.005, 0.0025)]
    assert np.diff(times) == pytest.approx([0.15, 0.15])
    assert times[0] == pytest.approx(0.1 + 0.15 * np.log2(20.0))
    slow = ReachConfig(speed_limit_m_per_s=0.05)
    assert 1.875 * 0.1 / movement_time(0.1, 0.01, slow) == pytest.approx(0.05)


def test_end_points_scatter_more_when_faster():
    config, rng = ReachConfig(speed_limit_m_per_s=10.0), np.random.default_rng(0)
    target = np.array([0.1, 0.0, 0.0])
    spread = []
    for width in (0.04, 0.002):
        ends = [aim(np.zeros(3), target, width, 0.0, config, rng).change - target for _ in range(1500)]
        spread.append(np.std(ends))
        assert spread[-1] == pytest.approx(scatter(0.1, movement_time(0.1, width, config), config), rel=0.05)
    assert spread[0] > spread[1]


def test_tremor_has_its_amplitude_and_band():
    tremor = Tremor(TremorConfig(), PERIOD_S, np.random.default_rng(0))
    x, v = (np.array(rows)[2000:] for rows in zip(*(tremor.step() for _ in range(102_000)), strict=True))
    assert x.std(axis=0) == pytest.approx(np.full(3, 7e-5), rel=0.1)
    power = np.abs(np.fft.rfft(x, axis=0)) ** 2
    frequency = np.fft.rfftfreq(len(x), PERIOD_S)
    inside = power[(frequency > 8.0) & (frequency < 12.0)].sum() / power.sum()
    assert inside == pytest.approx(2.0 / np.pi * np.arctan(2.0), abs=0.03)
    assert np.diff(x, axis=0) / PERIOD_S == pytest.approx(v[1:])


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
    console = Console(ConsoleConfig())
    state = console.state()
    mapping = Mapping.aligned(MappingConfig(), state.position, np.zeros(3))
    operator = Operator(STILL, (), mapping, PERIOD_S, np.random.SeedSequence(0))
    assert operator.step(0.0, np.zeros(3), state).done
    moved = console.step(np.zeros(6), np.array([2.0, 1.0, -1.0, 0.0, 0.0, 0.0]))
    force = operator.step(PERIOD_S, np.zeros(3), moved).wrench[:3]
    expected = 135.0 * (state.position - moved.position) - 6.45 * moved.velocity
    assert force == pytest.approx(expected)


def test_same_seed_same_forces_and_reset_begins_again():
    goals = (Goal(position=(0.02, 0.01, 0.0)),)
    runs = [work_alone(goals, seed=seed)[0] for seed in (5, 5, 6)]
    assert np.array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0][:500], runs[2][:500])
    console = Console(ConsoleConfig())
    state = console.state()
    mapping = Mapping.aligned(MappingConfig(), state.position, np.zeros(3))
    operator = Operator(OperatorConfig(), goals, mapping, PERIOD_S, np.random.SeedSequence(5))
    first = [operator.step(k * PERIOD_S, np.zeros(3), state).wrench for k in range(600)]
    operator.reset()
    again = [operator.step(k * PERIOD_S, np.zeros(3), state).wrench for k in range(600)]
    assert np.array_equal(first, again)
