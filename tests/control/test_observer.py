"""Disturbance observer and delay estimate on simulated histories."""

from dataclasses import replace

import numpy as np
import pytest

from surgsim.control.observer import (
    delay_size,
    estimate_delay,
    observe,
    observer_size,
    remember_command,
    torque_offset,
)

DT = 0.001
gains = pytest.mark.parametrize("gain", [0.1, 0.3, 1.0])


class Observer:
    """The disturbance observer and its memory."""

    def __init__(self, gain, damping):
        self.gain, self.damping, self.memory, self.first = gain, damping, np.zeros(observer_size(7)), True

    def update(self, p):
        M, bias = p.dyn.mass_matrix, p.dyn.bias
        d = observe(self.memory, self.first, M, bias, self.damping, p.v, p.tau_measured, self.gain, p.dt_s)
        self.first = False
        return d.copy()


class Delay:
    """The delay estimate and its memory."""

    def __init__(self, most):
        self.most, self.memory, self.first, self.ticks = most, np.zeros(delay_size(7, most)), True, 0

    def update(self, measured):
        self.ticks = estimate_delay(self.memory, self.first, measured, self.most, DT)
        self.first = False

    def sent(self, torque):
        remember_command(self.memory, self.most, torque)

    @property
    def offset(self):
        return torque_offset(self.memory, self.most, 7).copy()

    @property
    def in_flight(self):
        """Torques commanded and not yet acting, oldest first."""
        return self.memory[: 7 * self.ticks].reshape(-1, 7)[::-1].copy()


class LinearArm:
    """M v' + D v + bias = tau + d, stepped semi-implicitly in the damping, with everything constant."""

    def __init__(self, problem, damping, d):
        self.M, self.bias = problem.dyn.mass_matrix, problem.dyn.bias
        self.D, self.d = damping, d
        self.v = problem.v

    def step(self, tau):
        force = tau + self.d - self.bias - self.D * self.v
        self.v = self.v + DT * np.linalg.inv(self.M + DT * np.diag(self.D)) @ force


def _estimates(problem, gain, d, ticks, damping=None, seen=None):
    """Estimates after each update; the torque is random and differs each period."""
    damping = np.linspace(0.3, 1.5, 7) if damping is None else damping
    arm, rng = LinearArm(problem, damping, d), np.random.default_rng(0)
    observer = Observer(gain, damping)
    tau, found = np.full(7, np.nan), []
    for _ in range(ticks):
        found.append(observer.update(replace(problem, v=arm.v, tau_measured=tau)))
        tau = rng.uniform(-20.0, 20.0, 7)
        arm.step(tau if seen is None else seen(tau))
    return np.array(found)


@gains
def test_a_constant_disturbance_is_learned_as_one_minus_l_to_the_k(torque_problem, gain):
    d = np.array([5.0, -3.0, 2.0, 1.0, -0.5, 0.2, 0.05])
    found = _estimates(torque_problem(0), gain, d, 30)
    k = np.arange(30)[:, None]
    np.testing.assert_allclose(found, d * (1.0 - (1.0 - gain) ** k), atol=1e-8)


def test_without_a_disturbance_nothing_is_learned(torque_problem):
    np.testing.assert_allclose(_estimates(torque_problem(1), 0.5, np.zeros(7), 20), 0.0, atol=1e-9)


def test_a_gain_of_zero_switches_it_off(torque_problem):
    np.testing.assert_array_equal(_estimates(torque_problem(1), 0.0, np.ones(7), 10), 0.0)


def test_the_first_tick_says_nothing_and_start_forgets(torque_problem):
    observer, p = Observer(0.5, np.ones(7)), torque_problem(0)
    np.testing.assert_array_equal(observer.update(p), 0.0)
    assert np.abs(observer.update(replace(p, v=p.v + 0.1))).max() > 1.0
    observer.first = True
    np.testing.assert_array_equal(observer.update(p), 0.0)


def test_torque_that_was_measured_counts_and_not_the_one_commanded(torque_problem):
    """A plant that saturates at 10 N m, and torque measured where it acts: no disturbance."""
    p, d = torque_problem(2), np.zeros(7)
    wrong = _estimates(p, 0.5, d, 20, seen=lambda tau: np.clip(tau, -10.0, 10.0))
    assert np.abs(wrong[-1]).max() > 1.0  # told of the command instead, it would see one


def _delays(delay, commands, most=12):
    """Estimates of a queue of `delay` commands that is full of the first one at the start."""
    queue, estimate = [], Delay(most)
    measured, ticks = np.zeros(7), []
    for command in commands:
        estimate.update(measured)
        ticks.append(estimate.ticks)
        assert estimate.in_flight.shape == (estimate.ticks, 7)
        estimate.sent(command)
        queue = queue or [command] * delay
        queue.append(command)
        measured = queue.pop(0)
    return np.array(ticks), estimate, queue


@pytest.mark.parametrize("delay", range(11))
def test_delays_are_found_exactly_as_soon_as_they_show(delay):
    commands = np.random.default_rng(delay).standard_normal((60, 7))
    ticks, estimate, queue = _delays(delay, commands)
    shown = np.minimum(np.maximum(np.arange(60) - 1, 0), delay)
    np.testing.assert_array_equal(ticks, shown)
    estimate.update(commands[-1 - delay])
    np.testing.assert_array_equal(estimate.in_flight, queue if delay else np.zeros((0, 7)))


@pytest.mark.parametrize("delay", [0, 4, 10])
def test_delays_are_found_in_slow_torques_with_little_motion(delay):
    t = DT * np.arange(400)
    commands = 20.0 + 0.01 * np.sin(np.outer(t, np.arange(1.0, 8.0)))
    ticks, _, _ = _delays(delay, commands)
    assert ticks[-1] == delay


def test_at_rest_the_shortest_delay_counts():
    ticks, _, _ = _delays(7, np.ones((50, 7)))
    np.testing.assert_array_equal(ticks, 0)


def test_a_delay_once_found_stays_through_a_rest():
    rng = np.random.default_rng(0)
    commands = np.concatenate([rng.standard_normal((30, 7)), np.ones((20, 7))])
    ticks, _, _ = _delays(5, commands)
    np.testing.assert_array_equal(ticks[10:], 5)


def test_a_change_of_the_delay_is_followed():
    rng = np.random.default_rng(0)
    estimate, history = Delay(12), []
    for k in range(400):
        delay = 2 if k < 200 else 9
        measured = history[max(len(history) - 1 - delay, 0)] if history else np.zeros(7)
        estimate.update(measured)
        if k in (199, 399):
            assert estimate.ticks == delay
        history.append(rng.standard_normal(7))
        estimate.sent(history[-1])


def test_with_no_delay_allowed_none_is_found():
    ticks, estimate, _ = _delays(5, np.random.default_rng(0).standard_normal((30, 7)), most=0)
    np.testing.assert_array_equal(ticks, 0)
    assert estimate.in_flight.shape == (0, 7)


@pytest.mark.parametrize("delay", [0, 4])
def test_the_mean_offset_of_the_measured_torque_is_found_at_its_rate(delay):
    rng, bias = np.random.default_rng(1), np.linspace(-1.0, 1.0, 7)
    estimate, history, offsets = Delay(12), [], []
    for _ in range(600):
        sent = history[max(len(history) - 1 - delay, 0)] if history else -bias
        estimate.update(sent + bias)
        offsets.append(estimate.offset)
        history.append(5.0 * rng.standard_normal(7))
        estimate.sent(history[-1])
    assert estimate.ticks == delay
    learning = np.maximum(np.arange(600) - 12, 0)  # once as many commands are known as a delay may span
    expected = bias * (1.0 - (1.0 - DT / 0.05) ** learning)[:, None]
    np.testing.assert_allclose(offsets[-1], bias, atol=1e-3)
    if delay == 0:
        np.testing.assert_allclose(offsets, expected, atol=1e-9)
