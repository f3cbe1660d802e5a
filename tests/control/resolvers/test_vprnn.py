"""VPRNN against the paper's matrices, the optimum of eq. (22) and numerical integration of eq. (27)."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import null_space
from usual_arm import usual_arm

from surgsim.control.failure import ControlFailure
from surgsim.control.manipulability import jacobian_gradient
from surgsim.control.rcm import rcm_cross_form
from surgsim.control.resolvers.vprnn import VprnnConfig
from surgsim.control.resolvers.vprnn_system import Network, decayed

LATE = 10.0  # beta exp(10) of a period of 1 ms: nothing is left of delta
TABLE_1 = {"h0": 0.1, "h1": 10.0, "h2": 50.0, "h3": 30.0, "h4": 30.0, "k1": 5.0, "k2": 5.0, "beta": 1e3}
seeds = pytest.mark.parametrize("seed", range(3))


def _unbounded(problem):
    return replace(problem, lower=np.full(7, -np.inf), upper=np.full(7, np.inf))


@pytest.fixture
def problem(velocity_problem, seed):
    return _unbounded(velocity_problem(seed))


def _vec(matrix):
    return matrix.ravel(order="F")


def _rows(p, *, cross=False):
    """J_T, J_rcm and the right sides of eq. (20) with Table I's gains."""
    v_d = p.command.v_WTd - 5.0 * (p.kin.p_WT - p.command.p_WTd)
    if p.rcm is None:
        return p.kin.Jv_WT, np.zeros((0, 7)), v_d, np.zeros(0)
    if cross:
        E, J_rcm = rcm_cross_form(p.kin, p.p_WC)
        return p.kin.Jv_WT, J_rcm, v_d, np.cross(p.kin.R_WT[:, 2], p.v_WC) - 5.0 * E
    return p.kin.Jv_WT, p.rcm.jacobian, v_d, p.rcm.trocar_velocity - 5.0 * p.rcm.error


def _literal_system(p, *, cross=False):
    """W and l of eq. (25), block by block as printed."""
    c = TABLE_1
    J, Jr, v_d, v_rcm = _rows(p, cross=cross)
    h = jacobian_gradient(J, p.kin.z_W)
    D = np.array([_vec(hi.T) for hi in h]) @ np.kron(np.eye(3), J.T)
    IA, vec_I = np.kron(np.eye(3), J @ J.T), _vec(np.eye(3))
    r, m, n2 = len(Jr), 7, 9

    def O(rows, columns):  # noqa: E743
        return np.zeros((rows, columns))

    w11 = c["h1"] * np.eye(m) + c["h2"] * J.T @ J + c["h3"] * Jr.T @ Jr
    W = np.block(
        [
            [w11, -c["h0"] * D, -J.T, -Jr.T, O(m, n2)],
            [-c["h0"] * D.T, c["h4"] * IA @ IA, O(n2, 3), O(n2, r), -IA],
            [J, O(3, n2), O(3, 3), O(3, r), O(3, n2)],
            [Jr, O(r, n2), O(r, 3), O(r, r), O(r, n2)],
            [O(n2, m), IA, O(n2, 3), O(n2, r), O(n2, n2)],
        ]
    )
    l11 = c["h2"] * J.T @ v_d + c["h3"] * Jr.T @ v_rcm
    return W, np.concatenate([l11, c["h4"] * IA @ vec_I, v_d, v_rcm, vec_I])


def _gradient(p):
    """Gradient of ln mu by central differences of its trace form, eq. (15)."""
    J = p.kin.Jv_WT
    return np.array([np.trace(h @ J.T @ np.linalg.inv(J @ J.T)) for h in jacobian_gradient(J, p.kin.z_W)])


def _optimum(p):
    """Optimum of eq. (22): on the constraints the squared terms are constant, so only h0 and h1 count."""
    J, Jr, v_d, v_rcm = _rows(p)
    A, b = np.vstack([J, Jr]), np.concatenate([v_d, v_rcm])
    Z = null_space(A, rcond=1e-10)
    return np.linalg.pinv(A) @ b + TABLE_1["h0"] / TABLE_1["h1"] * Z @ Z.T @ _gradient(p)


def _step(config, p, memory=None):
    network = config.build(usual_arm())
    return network.step(p, network.start(p) if memory is None else memory)


def _memory(network, delta):
    """The network's memory after a step that left `delta`."""
    return np.concatenate([delta, np.zeros(network.memory_size - len(delta))])


def test_default_gains_are_those_of_table_1():
    config = VprnnConfig()
    assert {name: getattr(config, name) for name in TABLE_1} == TABLE_1


@seeds
@pytest.mark.parametrize("rows", ["normal", "cross"])
def test_system_is_eq_25(problem, rows):
    network = Network(VprnnConfig(rcm_rows=rows), usual_arm(), problem)
    for built, literal in zip(
        (network.W, network.l), _literal_system(problem, cross=rows == "cross"), strict=True
    ):
        np.testing.assert_allclose(built, literal, atol=1e-12)


@seeds
@pytest.mark.parametrize("error", [0.0, 0.01])
def test_with_cross_rows_the_paper_s_w_is_singular_everywhere(velocity_problem, seed, error):
    """Off the constraint the third row follows from the tip rows and the other two."""
    p = velocity_problem(seed, rcm_error_m=error)
    W = _literal_system(p, cross=True)[0]
    assert W.shape == (31, 31)
    assert np.linalg.matrix_rank(W, tol=1e-9) == 30
    J, Jr, _, _ = _rows(p, cross=True)
    assert np.linalg.matrix_rank(np.vstack([J, Jr]), tol=1e-9) == 5


@seeds
def test_converged_network_gives_the_optimum_of_eq_22(problem):
    p = replace(problem, t_s=LATE)
    answer, memory = _step(VprnnConfig(), p)
    np.testing.assert_array_equal(memory, 0.0)
    np.testing.assert_allclose(answer.qdot, _optimum(p), atol=1e-10)
    assert answer.residual < 1e-10


@seeds
def test_optimum_satisfies_kkt_and_nothing_near_it_is_better(problem):
    """The closed form of `_optimum` itself, against the objective (21) on the constraint set."""
    J, Jr, v_d, v_rcm = _rows(problem)
    c, g, best = TABLE_1, _gradient(problem), _optimum(problem)

    def f(x):
        tip, rcm = J @ x - v_d, Jr @ x - v_rcm
        return -c["h0"] * x @ g + c["h1"] / 2 * x @ x + c["h2"] / 2 * tip @ tip + c["h3"] / 2 * rcm @ rcm

    np.testing.assert_allclose([*(J @ best - v_d), *(Jr @ best - v_rcm)], 0.0, atol=1e-12)
    for direction in null_space(np.vstack([J, Jr]), rcond=1e-10).T:
        assert f(best + 1e-3 * direction) > f(best)
        assert f(best - 1e-3 * direction) > f(best)


@seeds
def test_without_a_trocar_it_is_the_optimum_under_three_rows(velocity_problem, seed):
    p = _unbounded(velocity_problem(seed, trocar=False, t_s=LATE))
    np.testing.assert_allclose(_step(VprnnConfig(), p)[0].qdot, _optimum(p), atol=1e-10)


@seeds
@pytest.mark.parametrize("trocar", [True, False])
def test_block_solve_equals_a_dense_solve_of_the_whole_system(velocity_problem, seed, trocar):
    p = _unbounded(velocity_problem(seed, trocar=trocar, t_s=0.3))
    W, l = _literal_system(p)  # noqa: E741
    delta = np.random.default_rng(seed).standard_normal(len(l))
    network = VprnnConfig().build(usual_arm())
    answer, memory = network.step(p, _memory(network, delta))
    after = memory[: len(delta)]
    np.testing.assert_allclose(answer.qdot, np.linalg.solve(W, l + after)[:7], atol=1e-8)
    assert 0.0 < np.linalg.norm(after) < 0.5 * np.linalg.norm(delta)


@seeds
@pytest.mark.parametrize("integration", ["exact", "euler"])
def test_the_network_starts_at_zero(problem, integration):
    answer, _ = _step(VprnnConfig(integration=integration, beta=1e-9), problem)
    np.testing.assert_allclose(answer.qdot, 0.0, atol=1e-9)


def _integrated(delta, start, period, beta, cap, bound):
    """Eq. (27) with (28), the exponent capped, by a fine numerical integration."""

    def rate(t, x):
        phi = x if bound is None else np.clip(x, -bound, bound)
        return -beta * math.exp(min(t, cap)) * phi

    done = solve_ivp(rate, (start, start + period), delta, rtol=1e-10, atol=1e-12, max_step=period / 200)
    return done.y[:, -1]


@pytest.mark.parametrize("bound", [None, 0.3, 5.0])
@pytest.mark.parametrize("start", [0.0, 0.4, 2.0])
@pytest.mark.parametrize("cap", [0.0, 0.7, 20.0])
def test_step_of_delta_is_the_solution_of_eq_27(bound, start, cap):
    config = VprnnConfig(beta=1.3, exponent_cap=cap, activation_bound=bound)
    delta = np.array([-4.0, -0.31, -0.2, 0.0, 1e-3, 0.29, 0.9, 2.0])
    stepped = decayed(config.build(usual_arm()).gains, delta, start, 0.6)
    np.testing.assert_allclose(stepped, _integrated(delta, start, 0.6, 1.3, cap, bound), atol=2e-6)


@given(
    st.lists(st.floats(-100, 100), min_size=1, max_size=5),
    st.floats(0, 30),
    st.one_of(st.none(), st.floats(0.01, 10.0)),
)
def test_two_half_steps_of_delta_equal_a_whole_one(delta, start, bound):
    config = VprnnConfig(beta=2.0, exponent_cap=3.0, activation_bound=bound)
    gains = config.build(usual_arm()).gains
    halves = decayed(gains, decayed(gains, np.array(delta), start, 0.01), start + 0.01, 0.01)
    whole = decayed(gains, np.array(delta), start, 0.02)
    np.testing.assert_allclose(halves, whole, rtol=1e-6, atol=1e-9)
    assert (np.abs(whole) <= np.abs(delta)).all()
    assert (whole * np.array(delta) >= 0.0).all()


def _run(config, p, start_s, steps):
    """The answers of `steps` periods on a constant problem, from z = 0."""
    network = config.build(usual_arm())
    memory, answers = network.start(p), []
    for k in range(steps):
        answer, memory = network.step(replace(p, t_s=start_s + k * p.dt_s), memory)
        answers.append(answer)
    return answers


@pytest.mark.parametrize("seed", [1])
def test_literal_euler_approaches_the_exact_step_at_first_order(problem):
    def gap(period):
        p, steps = replace(problem, dt_s=period), round(0.01 / period)
        end = [
            _run(VprnnConfig(beta=100.0, integration=name), p, 0.0, steps)[-1].qdot
            for name in ("exact", "euler")
        ]
        return np.abs(end[0] - end[1]).max()

    coarse, fine = gap(2e-4), gap(1e-4)
    assert fine < 1e-2 * np.abs(_optimum(problem)).max()
    assert coarse / fine == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize("seed", [1])
@pytest.mark.parametrize(("period", "limit"), [(1e-3, math.log(2.0)), (5e-4, math.log(4.0))])
def test_literal_euler_is_stable_only_until_the_gain_times_the_period_is_two(problem, period, limit):
    p = replace(problem, dt_s=period)
    steps = round(0.1 / period)
    before = _run(VprnnConfig(integration="euler"), p, limit - 0.15, steps)
    assert before[-1].residual < 1e-9
    with pytest.raises(ControlFailure, match="exceeds 1e12"):  # from round-off
        _run(VprnnConfig(integration="euler"), p, limit + 0.5, 20000)
    exact = _run(VprnnConfig(), p, limit + 0.5, 20)
    assert exact[-1].residual < 1e-9


@pytest.mark.parametrize("seed", [1])
@pytest.mark.parametrize("cap", [20.0, 700.0])
@pytest.mark.parametrize("bound", [None, 0.1])
def test_a_run_of_a_million_seconds_does_not_overflow(problem, cap, bound):
    config = VprnnConfig(exponent_cap=cap, activation_bound=bound)
    network = config.build(usual_arm())
    answer, memory = network.step(replace(problem, t_s=1e6), _memory(network, np.ones(30)))
    np.testing.assert_allclose(answer.qdot, _optimum(problem), atol=1e-9)
    np.testing.assert_allclose(memory, 0.0, atol=1e-9)


@given(
    st.integers(0, 200),
    st.booleans(),
    st.sampled_from(["exact", "euler"]),
    st.floats(0.0, 30.0),
    st.floats(0.0, 50.0),
)
@settings(deadline=None, max_examples=50)
def test_the_answer_is_always_inside_the_bounds(velocity_problem, seed, trocar, integration, t_s, speed):
    p = velocity_problem(seed, trocar=trocar, t_s=t_s, speed=speed)
    answer, _ = _step(VprnnConfig(integration=integration), p)
    assert (answer.qdot >= p.lower).all()
    assert (answer.qdot <= p.upper).all()


@pytest.mark.parametrize("seed", [2])
def test_a_bound_activation_converges_slower_but_to_the_same_answer(problem):
    config = VprnnConfig(beta=50.0, activation_bound=0.005)
    free, bound = (_run(c, problem, 0.0, 10)[-1].residual for c in (VprnnConfig(beta=50.0), config))
    assert bound > 1.2 * free
    end = _run(config, replace(problem, dt_s=0.1), 0.0, 100)[-1]
    np.testing.assert_allclose(end.qdot, _optimum(problem), atol=1e-9)


@seeds
@pytest.mark.parametrize(("error", "tolerance"), [(0.0, 1e-10), (1e-4, 1e-6), (1e-3, 1e-4)])
def test_cross_rows_agree_with_normal_rows_to_second_order_of_the_error(
    velocity_problem, seed, error, tolerance
):
    p = _unbounded(velocity_problem(seed, rcm_error_m=error, trocar_speed=0.0, t_s=LATE))
    cross, normal = (_step(VprnnConfig(rcm_rows=rows), p)[0].qdot for rows in ("cross", "normal"))
    np.testing.assert_allclose(cross, normal, atol=tolerance)


def test_cross_rows_follow_a_moving_trocar(velocity_problem):
    p = _unbounded(velocity_problem(0, rcm_error_m=0.0, trocar_speed=0.05, t_s=LATE))
    cross, normal = (_step(VprnnConfig(rcm_rows=rows), p)[0].qdot for rows in ("cross", "normal"))
    np.testing.assert_allclose(cross, normal, atol=1e-6)
