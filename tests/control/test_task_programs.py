"""Tasks under limits: strict priority and weights against daqp, and limits that exclude each other."""

from types import SimpleNamespace

import daqp
import numpy as np
import pytest

from surgsim.control.relaxation import relax
from surgsim.control.task_programs import solve_tasks
from surgsim.tick.status import GOES_ON

N, TASKS, EQUALITY = 7, 5, 5
STRICT = np.zeros(3)
TIP, RCM = slice(0, 3), slice(3, 5)


def random_case(rng, extra=1):
    """Inertia, demand and limits of an arm that does not exist; rest keeps the limits."""
    A, demand = rng.standard_normal((N, N)), 10.0 ** rng.uniform(0.5, 3.0)
    torque, M = rng.uniform(10.0, 200.0, N), 0.3 * A @ A.T / N + 0.05 * np.eye(N)
    constant = 0.5 * torque * rng.uniform(-1.0, 1.0, N)
    return SimpleNamespace(
        M=M,
        J=0.5 * rng.standard_normal((TASKS, N)),
        a=demand * rng.standard_normal(TASKS),
        posture=demand * rng.standard_normal(N),
        rows=np.vstack([M, 0.3 * rng.standard_normal((extra, N))]),
        lower=np.r_[-rng.uniform(5.0, 100.0, N), -torque - constant, np.full(extra, -np.inf)],
        upper=np.r_[rng.uniform(5.0, 100.0, N), torque - constant, rng.uniform(0.0, 5.0, extra)],
        demand=demand,
    )


def solved(c, weights=STRICT, hard=N):
    """Q'', the answer without limits, whether limits gave way, and the bounds that then hold."""
    held = len(c.rows)
    rows = np.vstack([c.rows, np.empty((TASKS, N))])
    lower, upper = np.r_[c.lower, np.empty(TASKS)], np.r_[c.upper, np.empty(TASKS)]
    qddot, free, sides = np.empty(N), np.empty(N), np.zeros(N + held + TASKS)
    status, gave_way = solve_tasks(
        c.M, c.J, c.a, c.posture, weights, rows, held, hard, lower, upper, sides, qddot, free
    )
    assert status == GOES_ON
    return qddot, free, gave_way, (lower[: N + held], upper[: N + held])


def solve(H, f, A, low, high, equal):
    """A program of daqp: the last `equal` rows are equalities."""
    sense = np.zeros(len(A), dtype=np.int32)
    sense[len(A) - equal :] = EQUALITY
    x, _, flag, _ = daqp.solve(H, f, A, high, low, sense)
    return np.array(x) if flag > 0 else None


def lexicographic(c):
    """The cascade by daqp, each level with a slack as a variable and the ones above as equalities."""
    A, held, reached = np.vstack([np.eye(N), c.rows]), np.zeros((0, N)), np.zeros(0)
    for level in (RCM, TIP):
        J, a = c.J[level], c.a[level]
        k = len(a)
        H = np.diag(np.r_[np.full(N, 1e-12), np.ones(k)])
        G = np.block(
            [
                [np.vstack([A, held]), np.zeros((len(A) + len(held), k))],
                [J, -np.eye(k)],
            ]
        )
        x = solve(
            H, np.zeros(N + k), G, np.r_[c.lower, reached, a], np.r_[c.upper, reached, a], len(held) + k
        )
        if x is None:
            return None
        held, reached = np.vstack([held, J]), np.r_[reached, J @ x[:N]]
    G = np.vstack([A, held])
    return solve(c.M, -c.M @ c.posture, G, np.r_[c.lower, reached], np.r_[c.upper, reached], len(held))


def shortfalls(c, x):
    """What RCM, tip and posture lack, over the demand."""
    lack = [np.linalg.norm(c.J[level] @ x - c.a[level]) for level in (RCM, TIP)]
    off = x - c.posture
    return np.array([*lack, np.sqrt(off @ c.M @ off)]) / c.demand


def test_the_strict_cascade_is_the_lexicographic_solution_of_another_solver():
    rng, differences, limited = np.random.default_rng(0), [], np.zeros(3)
    for _ in range(600):
        c = random_case(rng)
        x, free, gave_way, _ = solved(c)
        assert not gave_way
        assert max((c.lower - np.r_[x, c.rows @ x]).max(), (np.r_[x, c.rows @ x] - c.upper).max()) < 1e-6
        other = lexicographic(c)
        if other is None:  # daqp gives up on a degenerate one now and then
            continue
        lack = shortfalls(c, x)
        limited += np.r_[lack[:2] > 1e-4, np.abs(x - free).max() > 1e-4]
        differences.append(lack - shortfalls(c, other))
    worst = np.abs(differences)
    assert len(worst) >= 590
    assert (limited > 100).all()
    assert (limited < 590).all()
    assert worst[:, 0].max() < 1e-5  # of the RCM
    assert (np.quantile(worst, 0.98, axis=0) < [1e-6, 1e-5, 1e-4]).all()
    assert (np.max(differences, axis=0) < [1e-5, 1e-4, 1e-4]).all()  # no level lacks more than it must


def test_where_all_tasks_can_be_met_one_program_is_the_closed_form():
    rng = np.random.default_rng(1)
    for _ in range(50):
        c = random_case(rng)
        c.lower, c.upper = -1e6 * np.ones_like(c.lower), 1e6 * np.ones_like(c.upper)
        K = np.block([[c.M, c.J.T], [c.J, np.zeros((TASKS, TASKS))]])
        expected = np.linalg.solve(K, np.r_[c.M @ c.posture, c.a])[:N]
        x, free, _, _ = solved(c)
        np.testing.assert_allclose(x, expected, rtol=0, atol=1e-9 * c.demand * np.linalg.cond(K))
        np.testing.assert_array_equal(free, x)


def test_the_weighted_program_is_that_of_another_solver():
    rng, weights, limited = np.random.default_rng(2), np.array([10.0, 1.0, 1e-3]), 0
    for _ in range(300):
        c = random_case(rng)
        x, free, _, _ = solved(c, weights)
        w = np.repeat(weights[[1, 0]], [3, 2])
        H = c.J.T @ (w[:, None] * c.J) + weights[2] * c.M
        f = -c.J.T @ (w * c.a) - weights[2] * c.M @ c.posture
        other = solve(H, f, np.vstack([np.eye(N), c.rows]), c.lower, c.upper, 0)
        np.testing.assert_allclose(x, other, rtol=0, atol=1e-6 * c.demand)
        np.testing.assert_allclose(free, np.linalg.solve(H, -f), rtol=0, atol=1e-6 * c.demand)
        limited += np.abs(x - free).max() > 1e-3
    assert limited > 100


def test_under_limits_weights_trade_the_rcm_for_the_tip_and_strict_priority_does_not():
    rng, weights, traded = np.random.default_rng(3), np.array([10.0, 1.0, 1e-3]), 0
    for _ in range(200):
        c = random_case(rng)
        strict, weighted = shortfalls(c, solved(c)[0]), shortfalls(c, solved(c, weights)[0])
        assert strict[0] <= weighted[0] + 1e-6
        traded += weighted[0] > strict[0] + 1e-2
    assert traded > 50


def conflicting(rng):
    """Torques that barely move, while joints must brake and the shaft must come back."""
    c = random_case(rng, extra=2)
    rest = rng.uniform(-3.0, 3.0, N)  # M q'' of the only torques there are
    c.lower[N : 2 * N], c.upper[N : 2 * N] = rest - 1e-3, rest + 1e-3
    c.upper[2 * N :] = -rng.uniform(1.0, 5.0, 2)
    for i in rng.choice(N, 3, replace=False):
        c.lower[i], c.upper[i] = -100.0, -50.0
    return c


def least(A, low, high, G, g_low, g_high):
    """The least |s| with low <= A x - |A| s <= high and the rows G kept, by daqp."""
    k, size = len(A), np.linalg.norm(A, axis=1)
    H = np.diag(np.r_[np.full(N, 1e-12), np.ones(k)])
    rows = np.block([[A, -np.diag(size)], [G, np.zeros((len(G), k))]])
    x = solve(H, np.zeros(N + k), rows, np.r_[low, g_low], np.r_[high, g_high], 0)
    return x[N:]


def test_limits_that_exclude_each_other_give_way_by_the_least_and_in_order():
    rng, barriers = np.random.default_rng(4), 0
    for _ in range(100):
        c = conflicting(rng)
        low, high = c.lower.copy(), c.upper.copy()
        assert relax(c.rows, len(c.rows), N, low, high)
        torque = slice(N, 2 * N)
        np.testing.assert_array_equal(low[torque], c.lower[torque])  # the drives' own never give way
        np.testing.assert_array_equal(high[torque], c.upper[torque])
        s = least(np.eye(N), c.lower[:N], c.upper[:N], c.M, c.lower[torque], c.upper[torque])
        np.testing.assert_allclose(high[:N] - c.upper[:N], np.maximum(s, 0.0), atol=1e-4)
        np.testing.assert_allclose(c.lower[:N] - low[:N], np.maximum(-s, 0.0), atol=1e-4)
        above = np.vstack([np.eye(N), c.M])
        soft = c.rows[N:]
        s = least(soft, c.lower[2 * N :], c.upper[2 * N :], above, low[: 2 * N], high[: 2 * N])
        given = (high[2 * N :] - c.upper[2 * N :]) / np.linalg.norm(soft, axis=1)
        np.testing.assert_allclose(given, np.maximum(s, 0.0), atol=1e-3)
        barriers += (given > 0.1).any()
        x, _, gave_way, (low, high) = solved(c)
        assert gave_way
        value = np.r_[x, c.rows @ x]
        assert max((low - value).max(), (value - high).max()) < 1e-6
    assert barriers > 50


def test_limits_that_do_not_are_left_alone():
    rng = np.random.default_rng(5)
    for _ in range(50):
        c = random_case(rng)
        low, high = c.lower.copy(), c.upper.copy()
        assert relax(c.rows, len(c.rows), N, low, high)
        np.testing.assert_allclose(low, c.lower, atol=2e-7)
        np.testing.assert_allclose(high, c.upper, atol=2e-7)


def test_hard_rows_that_exclude_each_other_have_no_answer():
    c = random_case(np.random.default_rng(6), extra=0)
    c.rows = np.vstack([c.M, c.M[:1]])
    low, high = np.r_[c.lower, 1e4], np.r_[c.upper, np.inf]
    assert not relax(c.rows, N + 1, N + 1, low, high)


@pytest.mark.parametrize("weights", [STRICT, np.array([10.0, 1.0, 1e-3])])
def test_a_warm_start_changes_nothing(weights):
    rng = np.random.default_rng(7)
    sides = np.zeros(N + N + 1 + TASKS)
    for _ in range(100):
        c = random_case(rng)
        rows = np.vstack([c.rows, np.empty((TASKS, N))])
        lower, upper = np.r_[c.lower, np.empty(TASKS)], np.r_[c.upper, np.empty(TASKS)]
        x, free = np.empty(N), np.empty(N)
        solve_tasks(c.M, c.J, c.a, c.posture, weights, rows, N + 1, N, lower, upper, sides, x, free)
        np.testing.assert_allclose(x, solved(c, weights)[0], rtol=0, atol=1e-7 * c.demand)
