"""Acceleration limits, and the programs that give way in strict priority under them."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import nnls

from surgsim.control.acceleration import TORQUE_SHARE, allows, fill_acceleration_bounds, prioritised
from surgsim.control.seen import new_seen
from surgsim.tick.status import GOES_ON, INFEASIBLE

DT = 0.001


class Limits:
    """The arm's limits as the kernels take them."""

    def __init__(self, arm):
        self.arm, self.torque = arm, TORQUE_SHARE * arm.limits.torque

    def bounds(self, q, v, dt_s):
        seen, low, high = new_seen(self.arm, dt_s=dt_s, has_trocar=False), np.empty(7), np.empty(7)
        fill_acceleration_bounds(seen, q, v, low, high)
        return low, high

    def allows(self, torque, qddot, q, v):
        seen = new_seen(self.arm, dt_s=DT, has_trocar=False)
        return allows(torque, self.torque, qddot, seen, q, v)


seeds = pytest.mark.parametrize("seed", range(4))


@pytest.fixture(scope="module")
def limits(arm):
    return Limits(arm)


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("dt", [0.001, 0.004])
def test_driving_at_the_bound_keeps_speed_and_range_until_rest(arm, limits, side, dt):
    """Full acceleration from the middle of the range; velocity limit, then the range's end, at rest."""
    q, v = 0.5 * (arm.limits.q_min + arm.limits.q_max), np.zeros(7)
    fastest = np.zeros(7)
    for _ in range(round(6.0 / dt)):
        low, high = limits.bounds(q, v, dt)
        a = np.clip(side * arm.limits.acceleration, low, high)
        braking = a * np.sign(v) < 0
        assert (np.abs(a[braking]) <= arm.limits.acceleration[braking] * (1 + 1e-9)).all()
        v = v + dt * a
        q = q + dt * v
        fastest = np.maximum(fastest, np.abs(v))
        assert (np.abs(v) <= arm.limits.velocity).all()
        assert (q >= arm.limits.q_min).all()
        assert (q <= arm.limits.q_max).all()
    end = arm.limits.q_max if side > 0 else arm.limits.q_min
    np.testing.assert_allclose(q, end, atol=1e-3)
    assert (fastest > 0.5 * arm.limits.velocity).all()


def test_a_joint_beyond_its_speed_limit_is_slowed_down(arm, limits):
    q, v = 0.5 * (arm.limits.q_min + arm.limits.q_max), 1.1 * arm.limits.velocity
    low, high = limits.bounds(q, v, DT)
    assert (low < high).all()
    assert (high < 0).all()


def test_a_joint_beyond_its_range_may_not_go_further(arm, limits):
    low, high = limits.bounds(arm.limits.q_max + 0.01, np.zeros(7), DT)
    np.testing.assert_allclose(high, 0.0, atol=1e-12)
    assert (low < 0).all()
    _, high = limits.bounds(arm.limits.q_max + 0.01, np.full(7, 0.1), DT)
    assert (high < 0).all()


def test_allowed_is_what_keeps_torque_and_acceleration(arm, limits):
    """What is asked of the bound on a joint's way alone is what both bounds of every joint say."""
    rng, zero, found = np.random.default_rng(5), np.zeros(7), []
    middle, half = 0.5 * (arm.limits.q_min + arm.limits.q_max), 0.5 * (arm.limits.q_max - arm.limits.q_min)
    for _ in range(2000):
        q = middle + half * rng.uniform(-1.02, 1.02, 7) ** 3
        v = 1.02 * arm.limits.velocity * rng.uniform(-1.0, 1.0, 7) ** 5
        low, high = limits.bounds(q, v, DT)
        qddot = low + (high - low) * rng.uniform(-0.02, 1.02, 7)
        found.append(limits.allows(zero, qddot, q, v))
        assert found[-1] == ((low <= qddot) & (qddot <= high)).all()
    assert 200 < sum(found) < 1800
    assert limits.allows(0.99 * limits.torque, zero, middle, zero)
    for joint in range(7):
        assert not limits.allows(-arm.limits.torque * np.eye(7)[joint], zero, middle, zero)
    assert not limits.allows(np.full(7, np.nan), zero, middle, zero)
    assert not limits.allows(zero, np.full(7, np.nan), middle, zero)


@pytest.fixture
def case(torque_problem, seed):
    """M, constant, J, a and posture of a random state."""
    p, rng = torque_problem(seed), np.random.default_rng(seed)
    return SimpleNamespace(
        M=p.dyn.mass_matrix,
        constant=p.dyn.bias,
        J=np.vstack([p.kin.Jv_WT, p.rcm.jacobian]),
        a=0.5 * rng.standard_normal(5),
        posture=rng.standard_normal(7),
    )


def _solve(case, limits, low=-1e4, high=1e4, torque=None, **changes):
    x, status = _solved(case, limits, low, high, torque, **changes)
    assert status == GOES_ON
    return x


def _solved(case, limits, low=-1e4, high=1e4, torque=None, **changes):
    c, x = SimpleNamespace(**{**vars(case), **changes}), np.zeros(7)
    most = limits.torque if torque is None else torque
    bounds = np.full(7, low), np.full(7, high)
    return x, prioritised(c.M, c.constant, c.J, c.a, c.posture, *bounds, most, x)


def _closed_form(c, rows=5):
    """The acceleration with J q'' = a nearest to the posture in the metric of M, by its KKT system."""
    J, a = c.J[:rows], c.a[:rows]
    K = np.block([[c.M, J.T], [J, np.zeros((rows, rows))]])
    return np.linalg.solve(K, np.concatenate([c.M @ c.posture, a]))[:7]


@seeds
@pytest.mark.parametrize("rows", [5, 3])
def test_without_active_limits_it_is_the_closed_form(case, limits, rows):
    x = _solve(case, limits, torque=np.full(7, 1e4), J=case.J[:rows], a=case.a[:rows])
    expected = _closed_form(case, rows)
    np.testing.assert_allclose(x, expected, atol=1e-4 * max(1.0, np.abs(expected).max()))


def _torques(case, x):
    return case.M @ x + case.constant


@seeds
def test_under_a_torque_limit_the_posture_gives_way_first(case, limits):
    """A limit that the closed form passes, but that rows of tip and RCM can live with."""
    free = _closed_form(case)
    pull = 20.0 * np.linalg.svd(case.J)[2][-1]  # posture motion of the null space alone
    wild = SimpleNamespace(**{**vars(case), "posture": case.posture + pull})
    torque = 1.05 * np.abs(_torques(case, free)) + 0.5
    assert (np.abs(_torques(case, _closed_form(wild))) > torque).any()
    x = _solve(wild, limits, torque=torque)
    assert (np.abs(_torques(case, x)) <= torque + 1e-6).all()
    np.testing.assert_allclose(case.J @ x, case.a, atol=1e-4)
    assert np.abs(x - _closed_form(wild)).max() > 0.1


@seeds
def test_then_the_tip_gives_way_and_the_rcm_is_still_met(case, limits):
    a = case.a * np.array([400.0, 400.0, 400.0, 1.0, 1.0])
    torque = np.abs(case.constant) + 2.0
    x = _solve(case, limits, torque=torque, a=a)
    assert (np.abs(_torques(case, x)) <= torque + 1e-6).all()
    np.testing.assert_allclose(case.J[3:] @ x, a[3:], atol=1e-6)
    assert np.linalg.norm(case.J[:3] @ x - a[:3]) > 1.0


@seeds
def test_the_tip_gives_away_no_more_than_it_must(case, limits):
    """No feasible acceleration with the same RCM rows comes nearer to the tip's."""
    a = case.a * np.array([400.0, 400.0, 400.0, 1.0, 1.0])
    torque, rng = np.abs(case.constant) + 2.0, np.random.default_rng(0)
    x = _solve(case, limits, torque=torque, a=a)
    missed = np.linalg.norm(case.J[:3] @ x - a[:3])
    below = np.eye(7) - np.linalg.pinv(case.J[3:]) @ case.J[3:]
    tried = 0
    for _ in range(2000):
        other = x + 10.0 ** rng.uniform(-3, 1) * below @ rng.standard_normal(7)
        if (np.abs(_torques(case, other)) <= torque).all():
            tried += 1
            assert np.linalg.norm(case.J[:3] @ other - a[:3]) > missed - 1e-6
    assert tried > 50


@seeds
def test_last_the_rcm_gives_way_and_the_limits_never_do(case, limits):
    a = case.a * np.array([1.0, 1.0, 1.0, 4000.0, 4000.0])
    torque = np.abs(case.constant) + 2.0
    x = _solve(case, limits, low=-30.0, high=30.0, torque=torque, a=a)
    assert (np.abs(_torques(case, x)) <= torque + 1e-6).all()
    assert (np.abs(x) <= 30.0 + 1e-6).all()
    assert np.linalg.norm(case.J[3:] @ x - a[3:]) > 1.0


@seeds
def test_acceleration_bounds_hold(case, limits):
    a = case.a * 50.0
    x = _solve(case, limits, low=-1.0, high=1.0, torque=np.full(7, 1e4), a=a)
    assert (np.abs(x) <= 1.0 + 1e-5).all()


@pytest.mark.parametrize("seed", [0])
@pytest.mark.parametrize(
    "contradiction", [{"low": 1.0, "high": -1.0}, {"low": -1e-6, "high": 1e-6, "torque": np.full(7, 1e-3)}]
)
def test_contradictory_limits_are_an_outcome(case, limits, contradiction):
    assert _solved(case, limits, **contradiction)[1] == INFEASIBLE


def _random_case(rng, demand):
    """Inertia, load, rows and limits of an arm that does not exist; rest keeps the limits."""
    A = rng.standard_normal((7, 7))
    torque = rng.uniform(10.0, 200.0, 7)
    return SimpleNamespace(
        M=0.3 * A @ A.T / 7.0 + 0.05 * np.eye(7),
        constant=0.5 * torque * rng.uniform(-1.0, 1.0, 7),
        J=0.5 * rng.standard_normal((5, 7)),
        a=demand * rng.standard_normal(5),
        posture=demand * rng.standard_normal(7),
        low=-rng.uniform(5.0, 100.0, 7),
        high=rng.uniform(5.0, 100.0, 7),
        torque_limit=torque,
    )


def _unmet(gradient, limits, rows):
    """What active limits, with multipliers of the right sign, and rows leave of a level's gradient."""
    A = np.vstack([limits, rows, -rows])
    if not len(A):
        return np.linalg.norm(gradient)
    return nnls((A / np.linalg.norm(A, axis=1)[:, None]).T, gradient, maxiter=2000)[1]


def _shortfall(c, x, demand):
    """By how much RCM, tip and posture each miss their optimality conditions, relative to the demand."""
    torque = c.M @ x + c.constant
    rows, value = np.vstack([np.eye(7), c.M]), np.r_[x, torque]
    low, high = np.r_[c.low, -c.torque_limit], np.r_[c.high, c.torque_limit]
    near = 1e-5 * (1.0 + high)
    limits = np.vstack([rows[value - low < near], -rows[high - value < near]])
    tip, rcm = slice(0, 3), slice(3, 5)
    levels = (
        (c.J[rcm].T @ (c.J[rcm] @ x - c.a[rcm]), c.J[:0]),
        (c.J[tip].T @ (c.J[tip] @ x - c.a[tip]), c.J[rcm]),
        (c.M @ (x - c.posture), c.J),
    )
    return np.array([_unmet(gradient, limits, above) for gradient, above in levels]) / demand


@pytest.mark.parametrize("demand", [10.0, 100.0, 1000.0])
def test_no_level_is_ever_lost(demand):
    """On 1,000 random problems: every level has an answer, and meets its conditions under those above it."""
    rng, limited = np.random.default_rng(0), 0
    for _ in range(1000):
        c, x = _random_case(rng, demand), np.zeros(7)
        assert prioritised(**vars(c), qddot=x) == GOES_ON
        torque = np.abs(c.M @ x + c.constant)
        assert max((x - c.high).max(), (c.low - x).max()) < 1e-6
        assert (torque < c.torque_limit + 1e-6).all()
        room = np.r_[c.torque_limit - torque, c.high - x, x - c.low]
        limited += room.min() < 1e-3
        assert (_shortfall(c, x, demand) < 2e-3).all()
    assert limited > 200


def test_a_lost_level_shows_in_its_conditions():
    rng, lost = np.random.default_rng(1), 0
    for _ in range(100):
        c = _random_case(rng, 10.0)
        without = SimpleNamespace(**{**vars(c), "posture": np.zeros(7)})
        x = np.zeros(7)
        prioritised(**vars(without), qddot=x)
        lost += _shortfall(c, x, 10.0)[2] > 0.01
    assert lost > 50
