"""The disturbance observer that is given positions alone."""

import numpy as np
import pytest

from surgsim.control.filters import filter_gains
from surgsim.control.observer import observe_positions, position_observer_size

N, T = 7, 1e-3


@pytest.fixture
def moving():
    """Inertia, damping and a constant disturbance; a generator of torques and the positions that follow."""
    rng = np.random.default_rng(5)
    root = rng.normal(size=(N, N))
    M, damping, d = root @ root.T + 0.2 * np.eye(N), rng.uniform(0, 1, N), rng.normal(size=N)

    def ticks(count):
        q, v = rng.normal(size=N), np.zeros(N)
        for k in range(count):
            tau = -d if k == 0 else -d + np.sin(0.02 * k + np.arange(N))
            if k > 0:
                a = np.linalg.solve(M, tau + d - damping * v)
                q, v = q + T * (v + T / 2 * a), v + T * a
            yield q, tau

    return M, damping, d, ticks


def observed(moving, state_hz, disturbance_hz, count, known=None):
    M, damping, _, ticks = moving
    memory, out = np.zeros(position_observer_size(N)), []
    gains = filter_gains(state_hz, disturbance_hz, T)
    for k, (q, tau) in enumerate(ticks(count)):
        bias = np.zeros(N) if known is None or k > 0 else known
        out.append(observe_positions(memory, k == 0, M, bias, damping, q, tau, gains, T).copy())
    return np.array(out)


def test_at_rest_the_torques_say_what_there_is_to_bear(moving):
    """No start-up transient, and none later: the arm moves as the model says."""
    out = observed(moving, 20.0, 5.0, 400)
    assert out == pytest.approx(np.broadcast_to(moving[2], out.shape), abs=1e-8)


def test_what_it_does_not_know_at_first_it_finds_at_its_own_pace(moving):
    """With a wrong first idea the error dies out as its slowest pole."""
    wrong = np.full(N, 1.0)
    out = observed(moving, 40.0, 5.0, 600, known=wrong) - moving[2]
    assert np.abs(out[0]).max() == pytest.approx(1.0)
    ratio = np.linalg.norm(out[500]) / np.linalg.norm(out[400])
    assert ratio == pytest.approx(np.exp(-2.0 * np.pi * 5.0 * 100 * T), rel=0.02)
