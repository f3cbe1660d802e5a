"""Tracking: quadratics without lag, noise smoothed as its memory says, samples that hold."""

import numpy as np
import pytest

from surgsim.control.port_estimators.base import PortProblem
from surgsim.control.port_estimators.tracking import TrackingConfig

DT = 0.001


@pytest.fixture
def follow(arm):
    """The estimates for a series of seen positions (n, 3) [m]."""
    kin = arm.kinematics(np.full(7, 0.3))

    def run(seen, dt=DT, **config):
        tracking, memory, out = TrackingConfig(**config).build(arm), None, []
        for k, p_WC in enumerate(seen):
            problem = PortProblem(
                t_s=k * dt,
                dt_s=dt,
                q=np.zeros(7),
                v=np.zeros(7),
                tau_measured=np.zeros(7),
                kin=kin,
                dyn=None,
                p_WC=p_WC,
                v_WC=np.zeros(3),
            )
            memory = tracking.start(problem) if memory is None else memory
            estimate, memory = tracking.step(problem, memory)
            out.append([estimate.p_WC, estimate.v_WC, estimate.a_WC])
        return np.array(out)

    return run


def test_a_port_at_rest_is_where_it_is_seen(follow):
    seen = np.tile([0.1, 0.5, 0.2], (200, 1))
    motion = follow(seen)
    np.testing.assert_array_equal(motion[:, 0], seen)
    np.testing.assert_array_equal(motion[:, 1:], 0.0)


def test_a_constant_acceleration_is_followed_without_lag(follow):
    t = np.arange(1000) * DT
    p0, v0, a = np.array([0.1, 0.5, 0.2]), np.array([0.01, 0.0, -0.02]), np.array([0.3, -0.1, 0.05])
    seen = p0 + np.outer(t, v0) + np.outer(0.5 * t**2, a)
    motion = follow(seen, memory_s=0.02)[-1]
    np.testing.assert_allclose(motion[0], seen[-1], atol=1e-12)
    np.testing.assert_allclose(motion[1], v0 + a * t[-1], atol=1e-9)
    np.testing.assert_allclose(motion[2], a, atol=1e-7)


def test_a_step_dies_out_with_three_equal_poles(follow):
    """Error after a step of the position: (1 + c1 k + c2 k^2) b^k; its poles from the recursion itself."""
    seen = np.zeros((120, 3))
    seen[1:, 0] = 1.0
    b = np.exp(-DT / 0.005)
    error = 1.0 - follow(seen, memory_s=0.005, sample_hold_s=DT)[1:, 0, 0]
    residue = error[3:] - 3 * b * error[2:-1] + 3 * b**2 * error[1:-2] - b**3 * error[:-3]
    np.testing.assert_allclose(residue, 0.0, atol=1e-12)
    assert error[0] == pytest.approx(b**3)


def test_longer_memory_is_smoother(follow):
    noise = 1e-4 * np.random.default_rng(0).standard_normal((20000, 3))
    spread = [np.std(follow(noise, memory_s=m)[5000:, 1]) for m in (0.01, 0.04)]
    assert spread[0] > 5.0 * spread[1]
    assert spread[1] < 1e-4 / 0.04  # far below one noise step over the memory


def test_a_slow_tracker_is_taken_at_its_samples(follow):
    """50 samples a second held over 20 ticks, of a port at 10 mm/s: predicted between, not stepped."""
    t = np.arange(2000) * DT
    held = np.outer(0.01 * DT * (np.arange(2000) // 20 * 20), [1.0, 0.0, 0.0])
    motion = follow(held, memory_s=0.05)[1000:]
    np.testing.assert_allclose(motion[:, 1, 0], 0.01, rtol=1e-6)
    np.testing.assert_allclose(motion[:, 0, 0], 0.01 * t[1000:], atol=1e-9)


def test_a_port_that_has_stopped_is_at_rest_again(follow):
    t = np.arange(3000) * DT
    stopping = np.outer(np.where(t < 1.0, 0.01 * t, 0.01), [0.0, 1.0, 0.0])
    last = follow(stopping, memory_s=0.02)[-1]
    np.testing.assert_allclose(last[0], [0.0, 0.01, 0.0], atol=1e-6)
    np.testing.assert_allclose(last[1], 0.0, atol=1e-5)
