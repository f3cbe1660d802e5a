"""The console as a physical device: kinematics, limits, gravity, energy."""

import mujoco
import numpy as np
import pytest

from surgsim.teleop.console import (
    JOINTS,
    ConsoleConfig,
    load_console,
    new_console,
    renderable,
    step_console,
)

ZERO = np.zeros(6)


class Bench:
    """A console with its kernels, each with a copy of its answer returned."""

    def __init__(self, config=None, period_s=0.001):
        self.console, self.law, self.memory = new_console(config or ConsoleConfig(), period_s)
        self.model, self.data = self.console.model, self.console.data

    def step(self, wrench, hand):
        step_console(self.law, self.memory, wrench, hand)
        return self.state()

    def state(self):
        return self.memory.state.copy()

    def renderable(self, force):
        out = force.copy()
        renderable(self.law, self.memory, out)
        return out

    def reset(self):
        self.memory.base.view(np.uint8)[:] = 0
        self.console.reset(self.law, self.memory)


def wiggle(timestep_s, duration_s=2.0):
    """The account after a forced motion that stays away from the stops, and the energy that went round."""
    console = Bench(period_s=timestep_s)
    start, around = console.state().position, 0.0
    for k in range(round(duration_s / timestep_s)):
        t = k * timestep_s
        state = console.state()
        held = -40.0 * (state.position - start)
        hand = np.array([1.2 * np.sin(5 * t), 0.9 * np.cos(7 * t), 0.6 * np.sin(6 * t), 2e-3, 0.0, 1e-3])
        hand[:3] += held
        motor = np.array([-0.4 * np.sin(6 * t), 0.3 * np.sin(2 * t), 0.2 * np.cos(3 * t), 0.0, 0.0, 0.0])
        console.step(motor, hand)
        around += abs(float(hand[:3] @ state.velocity)) * timestep_s
    return console.memory.account, around


def test_the_account_closes_and_its_residual_falls_with_the_timestep():
    steps = (0.002, 0.001, 0.0005)
    residuals, around = zip(*((abs(e.residual_j), a) for e, a in map(wiggle, steps)), strict=True)
    assert around[1] > 0.05
    assert residuals[1] <= 0.01 * around[1]
    order = np.polyfit(np.log(steps), np.log(residuals), 1)[0]
    assert order > 0.8


def test_a_wrong_account_would_be_seen():
    account, around = wiggle(0.001)
    for part in ("hand_j", "damping_j", "friction_j"):
        assert abs(getattr(account, part)) > 0.01 * around


def test_without_forces_it_stands_still_anywhere():
    console = Bench()
    rng = np.random.default_rng(0)
    for _ in range(5):
        console.reset()
        console.data.qpos[:] += rng.uniform(-0.2, 0.2, 6)
        mujoco.mj_step1(console.model, console.data)
        before = console.data.qpos.copy()
        for _ in range(500):
            console.step(ZERO, ZERO)
        assert console.data.qpos == pytest.approx(before, abs=1e-6)


def test_velocity_is_the_derivative_of_the_position():
    console = Bench(period_s=1e-4)
    hand = np.array([0.5, 0.8, -0.4, 0.0, 0.0, 0.0])
    for _ in range(2000):
        before = console.state()
        after = console.step(ZERO, hand)
    mean = 0.5 * (before.velocity + after.velocity)
    assert np.linalg.norm(after.velocity) > 0.05
    assert (after.position - before.position) / 1e-4 == pytest.approx(mean, rel=1e-3, abs=1e-4)


def test_a_force_at_the_handle_needs_no_torque_of_the_gimbal():
    console = Bench()
    console.data.qpos[:] = [0.2, 0.3, -0.2, 0.4, -0.3, 0.5]
    mujoco.mj_forward(console.model, console.data)
    J = np.zeros((3, 6))
    mujoco.mj_jacSite(console.model, console.data, J, None, console.model.site("handle").id)
    assert np.abs(J[:, 3:]).max() < 1e-12
    assert np.linalg.matrix_rank(J[:, :3], tol=1e-3) == 3


def test_renderable_forces_pass_no_limit_and_others_are_shortened():
    console = Bench()
    limit = console.model.jnt_actfrcrange[:, 1]
    small = np.array([0.5, -0.5, 0.5])
    assert np.array_equal(console.renderable(small), small)
    for direction in np.vstack([np.eye(3), -np.eye(3)]):
        force = console.renderable(50.0 * direction)
        wrench = np.concatenate([force, np.zeros(3)])
        console.reset()
        console.step(wrench, -wrench)
        assert np.linalg.norm(force) <= 6.0 + 1e-9
        assert np.linalg.norm(force) >= 2.5
        assert force / np.linalg.norm(force) == pytest.approx(direction)
        assert np.all(np.abs(console.data.qfrc_actuator) <= limit + 1e-9)
        rendered = console.data.qfrc_actuator - console.data.qfrc_gravcomp
        assert rendered == pytest.approx(console.data.ctrl, abs=1e-9)


def test_motors_are_cut_at_their_limits():
    console = Bench()
    console.step(np.array([0.0, 100.0, 0.0, 0.0, 0.0, 0.0]), ZERO)
    assert console.data.qfrc_actuator[0] == pytest.approx(1.86)


def test_least_mass_is_a_lower_bound_over_the_workspace():
    model, config = load_console(), ConsoleConfig()
    data, rng, J, X = mujoco.MjData(model), np.random.default_rng(0), np.zeros((3, 6)), np.zeros((3, 6))
    least = []
    for _ in range(500):
        data.qpos[:] = rng.uniform(model.jnt_range[:, 0], model.jnt_range[:, 1])
        mujoco.mj_forward(model, data)
        mujoco.mj_jacSite(model, data, J, None, model.site("handle").id)
        mujoco.mj_solveM(model, data, X, J)
        least.append(1.0 / np.linalg.eigvalsh(J @ X.T).max())
    assert config.least_mass_kg <= min(least) < 1.3 * config.least_mass_kg


def test_names_and_reset():
    console = Bench()
    assert tuple(console.model.joint(i).name for i in range(6)) == JOINTS
    start = console.state()
    for _ in range(50):
        console.step(ZERO, np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]))
    assert console.memory.account.hand_j > 0.0
    console.reset()
    again = console.state()
    assert again.position == pytest.approx(start.position, abs=0.0)
    assert console.memory.account.hand_j == 0.0
    assert again.t_s == 0.0


def test_a_period_that_is_no_multiple_is_refused():
    with pytest.raises(ValueError, match="must be a multiple of timestep_s"):
        new_console(ConsoleConfig(timestep_s=0.0007), 0.001)
