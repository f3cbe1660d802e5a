"""The valve on the tip's drive: inertia, formulas, and 3,000 impacts in one dimension."""

import numpy as np
import pytest

from surgsim.control.tip_energy import affordable_speed, fill_tip_inertia, limit_press, throttle
from surgsim.plant.explicit import pressure
from surgsim.tick.arrays import Seen, new

H = 0.001


def _spd(rng, n):
    A = rng.normal(size=(n, n))
    return A @ A.T + n * np.eye(n)


@pytest.mark.parametrize("rows", [0, 2])
def test_the_inertia_is_that_of_the_tip_with_the_rcm_held(rows):
    """Against the dynamics: the acceleration under a tip force, of joints that the RCM's forces hold."""
    rng, seen = np.random.default_rng(rows), new(Seen, 7)
    M, J, C = _spd(rng, 7), rng.normal(size=(3, 7)), rng.normal(size=(rows, 7))
    seen.M[:], seen.Jv_WT[:], seen.rows = M, J, rows
    seen.J_rcm[:rows] = C
    found = np.empty((3, 3))
    assert fill_tip_inertia(seen, found)
    constrained = np.block([[M, -C.T], [C, np.zeros((rows, rows))]])
    for f in np.eye(3):
        qddot = np.linalg.solve(constrained, np.concatenate((J.T @ f, np.zeros(rows))))[:7]
        np.testing.assert_allclose(found @ (J @ qddot), f, atol=1e-9)


def test_a_command_is_scaled_to_the_energy_that_there_is():
    rng = np.random.default_rng(1)
    for _ in range(100):
        inertia, v, budget = _spd(rng, 3), rng.normal(size=3), rng.uniform(-1.0, 20.0)
        share = affordable_speed(inertia, v, budget)
        energy = 0.55 * share**2 * v @ inertia @ v
        assert 0.0 <= share <= 1.0
        assert share == 1.0 or energy == pytest.approx(max(budget, 0.0), abs=1e-12)


def test_the_drive_s_work_is_paid_for_and_motion_that_is_not_covered_is_braked():
    rng = np.random.default_rng(2)
    braked = 0
    for _ in range(500):
        inertia, v, a = _spd(rng, 3), 0.2 * rng.normal(size=3), 20.0 * rng.normal(size=3)
        budget, drive = rng.uniform(0.0, 1.0), a.copy()
        throttle(inertia, v, budget, H, drive)
        left = budget - 0.55 * v @ inertia @ v
        after = 0.55 * (v + H * drive) @ inertia @ (v + H * drive)
        if left >= 0.0:
            assert budget - after >= -1e-12
            np.testing.assert_allclose(np.cross(drive, a), 0.0, atol=1e-9)
        else:
            braked += 1
            assert drive @ inertia @ v <= 0.0
    assert 50 < braked < 450


def test_a_press_is_limited_and_what_leaves_is_not():
    inertia, f = np.diag([4.0, 5.0, 6.0]), np.array([0.0, 0.0, 8.0])
    for a, share in (([0.0, 3.0, -4.0], 10.0 / np.hypot(15.0, 24.0)), ([0.0, 3.0, 4.0], 1.0)):
        drive = np.array(a)
        limit_press(inertia, f, 10.0, drive)
        np.testing.assert_allclose(drive, share * np.array(a))


def _impact(rng, valve):
    """One impact without refill: tank left, its lowest, and the largest acceleration over its limit."""
    mass, tank, floor = rng.uniform(0.5, 20.0), rng.uniform(0.011, 0.2), 0.01
    k, b, most = 10.0 ** rng.uniform(2.5, 4.3), rng.uniform(0.0, 100.0), rng.uniform(5.0, 30.0)
    wanted, p = rng.uniform(0.05, 0.5), -rng.uniform(0.0, 0.005)
    inertia, v, lowest, ratio = mass * np.eye(3), 0.0, tank, 0.0
    if not valve:
        v = wanted
    else:
        v = wanted * affordable_speed(inertia, np.array([0.0, 0.0, wanted]), tank - floor)
    for _ in range(60):
        drive = np.array([0.0, 0.0, np.clip(100.0 * (wanted - v), -most, most)])
        if valve:
            throttle(inertia, np.array([0.0, 0.0, v]), max(tank - floor, 0.0), H, drive)
        f = pressure(p, v, k, b, 0.2 * H)
        after = v + H * (drive[2] - f / mass)
        tank -= 0.5 * H * f * (v + after)
        lowest, ratio = min(lowest, tank), max(ratio, abs(drive[2]) / most)
        v = after
        p += H * v
    return lowest - floor, ratio


def test_three_thousand_impacts_leave_the_tank_above_its_floor_and_no_limit_is_passed():
    rng = np.random.default_rng(3)
    found = np.array([_impact(rng, valve=True) for _ in range(3000)])
    assert found[:, 0].min() >= 0.0
    assert found[:, 1].max() <= 1.0
    without = np.array([_impact(rng, valve=False) for _ in range(300)])
    assert np.mean(without[:, 0] < 0.0) > 0.5
